"""Effects between command and rotor speed."""
