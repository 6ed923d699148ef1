"""Finding what is wrong with the input before and after solving: corners, flipped boards, disagreeing views."""
