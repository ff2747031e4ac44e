"""How the constants of Eq. 2 move with what the paper leaves open: a trial of one network, and sums over many."""
