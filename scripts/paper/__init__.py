"""What compare_with_paper is made of: the paper's figures, the runs beside them, their tables and plots."""
