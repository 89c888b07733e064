"""(filled in by this room)"""
