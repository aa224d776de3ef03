"""The built-in virtual cell: a robot with hidden errors, and a tracker that looks at it. All truth is Drake's."""
