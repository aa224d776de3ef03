"""What a program's text sets, read without running it."""

from truepath.deploying.settings import settings_in

TEXT = """def program():
  def later():
    set_payload(m=2, cog=[0.1, -0.2, 0])
  end
  set_tcp(p[0, 0, 0.1, 0, 0, -1.5])
  if get_standard_digital_in(0):
    set_payload_mass(3.5)
    set_target_payload(1, [0, 0, 0], [0, 0, 0, 0, 0, 0])
    set_tcp(tools[1])
  end
  set_payload(True)
  set_payload()
  set_payload(1, [0, 0])
  set_payload(HUGE)
end
""".replace("HUGE", "1" + 400 * "0")


def test_plain_numbers_are_found_wherever_they_stand():
    settings = settings_in(TEXT)
    assert [(each.line, each.mass_kg, each.centre_m) for each in settings.payloads] == [
        (3, 2.0, (0.1, -0.2, 0.0)),
        (7, 3.5, None),
        (8, 1.0, (0.0, 0.0, 0.0)),
    ]
    assert [(each.line, each.tool) for each in settings.tools] == [(5, (0.0, 0.0, 0.1, 0.0, 0.0, -1.5))]


def test_what_is_computed_is_named():
    assert settings_in(TEXT).unclear == (9, 11, 12, 13, 14)
