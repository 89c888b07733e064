"""What drives the model: rotor speed as measured or simulated from commands, and battery voltage."""
