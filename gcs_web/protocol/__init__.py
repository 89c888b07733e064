"""What page and server tell each other: JSON messages on one WebSocket, each a struct here and a type in the client.

`tools/page_types.py` writes the client's `core/protocol.ts` from these structs; a test proves that it is up to date.
Lengths in metres, times in seconds, positions in the map's world frame (z up). Angles are in degrees here, because
people read them; the server turns them into radians as they come in.
"""
