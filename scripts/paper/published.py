"""Figures of Bei & Fregly 2004, Med Eng Phys 26:777. Pairs are medial, lateral; rows as in results.QUANTITIES."""

# Table 2: patches, u-v lines, largest error [mm], CPU time of ray firing and of minimum distance [us] for a number of distances
# that the paper does not give.
TABLE2 = [("1", "original", None, 4459922, 879488), ("1", "minimized", 0.0412, 3789363, 437183),
          ("12", "minimized", 0.0486, 2175889, 2461545), ("24", "minimized", 0.0434, 2031059, 2791974),
          ("48", "minimized", 0.0397, 1929122, 3442914), ("96", "minimized", 0.0276, 1908546, 3577577)]
TABLE3 = {"large": [(565.6, 513.7), (14.17, 7.145), (4.216, 4.225), (1.640, 2.208), (344.9, 232.6)],
          "small": [(565.5, 513.1), (14.27, 7.146), (3.893, 3.854), (1.640, 2.190), (344.7, 234.3)]}
TABLE4 = {"linear": [(1467, 623.3), (35.82, 16.67), (28.09, 17.07), (16.60, 9.030), (88.37, 69.02)],
          "power law": [(1417, 613.1), (34.23, 15.95), (15.58, 11.34), (12.50, 8.017), (113.4, 76.47)]}
# Section 4; measurements: reference 39 of the paper.
STATIC_LOADS_N = (750, 1500, 2250, 3000)
STATIC_FLEXIONS_DEG = (0, 30, 60, 90)
# CPU time on a Pentium 4 of 2.4 GHz: static analysis, gait cycle, 50 x 50 afterwards.
TIMES = {"static": "about 60", "gait": "about 600", "replay": "less than 30"}
