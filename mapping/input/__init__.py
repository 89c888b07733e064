"""What a map is made from: images, masks, depth images, videos; what is wrong with them, and which of them to use."""
