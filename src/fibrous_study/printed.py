"""What the paper prints of Eq. 11: Table 1 with its 95 % half-widths, R² of section 3.2, alignments of Fig. 6.

Order of the terms H11^i H22^j: that of `fibrous.fitting.surface.TERMS`. No half-width is printed for β22 = 0.
"""

import numpy as np

C2_MPA = (1.56, -8.30, 14.10, -5.56, 33.70, -59.90, 5.47, -35.90, 67.25)
C2_HALF_WIDTH_MPA = (0.22, 1.89, 3.77, 0.58, 7.63, 16.27, 0.79, 7.57, 17.50)
C2_R_SQUARED = 0.47

C3 = (-11.84, 94.49, 70.46, -517.60, -106.90, -59.44, 474.80, 396.00, 0.0)
C3_HALF_WIDTH = (4.46, 28.61, 15.98, 97.80, 29.40, 13.25, 69.40, 75.60, np.nan)
C3_R_SQUARED = 0.73

# (H11, H22) of isotropy and of networks 1 to 5, whose points lie in the contours of Fig. 6d-g.
ALIGNMENTS = {
    "isotropy": (1.0 / 3.0, 1.0 / 3.0),
    "network_1": (0.35, 0.32),
    "network_2": (0.50, 0.32),
    "network_3": (0.36, 0.12),
    "network_4": (0.66, 0.18),
    "network_5": (0.74, 0.14),
}
