"""What the tests of programs share lies in this folder."""
