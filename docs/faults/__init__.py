"""What may befall a run or its files, and what is seen then: the cells of `make_faults`."""
