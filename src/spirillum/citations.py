"""The references that results rest on."""

from __future__ import annotations

from collections.abc import Iterable

from spirillum.errors import InputError
from spirillum.fluid.registry import find_model
from spirillum.version import own_version

REFERENCES: dict[str, str] = {
    "biorob2012": (
        "Experiments on In-Channel Swimming of an Untethered Biomimetic Robot with Different Helical Tails. "
        "IEEE RAS & EMBS International Conference on Biomedical Robotics and Biomechatronics (BioRob), 2012."
    ),
    "lighthill1976": "J. Lighthill. Flagellar hydrodynamics. SIAM Review 18:161-230, 1976.",
    "gray1955": (
        "J. Gray and G. J. Hancock. The propulsion of sea-urchin spermatozoa. "
        "Journal of Experimental Biology 32:802-814, 1955."
    ),
    "brennen1977": (
        "C. Brennen and H. Winet. Fluid mechanics of propulsion by cilia and flagella. "
        "Annual Review of Fluid Mechanics 9:339-398, 1977."
    ),
    "katz1975": (
        "D. F. Katz, J. R. Blake and S. L. Paveri-Fontana. On the movement of slender bodies near plane boundaries "
        "at low Reynolds number. Journal of Fluid Mechanics 72:529-540, 1975."
    ),
    "jeffrey1981": (
        "D. J. Jeffrey and Y. Onishi. The slow motion of a cylinder next to a plane wall. "
        "Quarterly Journal of Mechanics and Applied Mathematics 34:129-137, 1981."
    ),
    "ashmore2005": (
        "J. Ashmore, C. del Pino and T. Mullin. Cavitation in a lubrication flow between a moving sphere and a "
        "boundary. Physical Review Letters 94:124501, 2005."
    ),
    "brun2001": (
        "R. Brun, P. Reichert and H. R. Kunsch. Practical identifiability analysis of large environmental simulation "
        "models. Water Resources Research 37:1015-1030, 2001."
    ),
    "reynolds1886": (
        "O. Reynolds. On the theory of lubrication and its application to Mr. Beauchamp Tower's experiments. "
        "Philosophical Transactions of the Royal Society 177:157-234, 1886."
    ),
    "morozov2014": ("K. I. Morozov and A. M. Leshansky. The chiral magnetic nanomotors. Nanoscale 6:1580-1588, 2014."),
    "man2013": (
        "Y. Man and E. Lauga. The wobbling-to-swimming transition of rotated helices. "
        "Physics of Fluids 25:071904, 2013."
    ),
    "adler1946": "R. Adler. A study of locking phenomena in oscillators. Proceedings of the IRE 34:351-357, 1946.",
    "kalman1960": (
        "R. E. Kalman. A new approach to linear filtering and prediction problems. "
        "Journal of Basic Engineering 82:35-45, 1960."
    ),
    "smith1957": (
        "O. J. M. Smith. Closer control of loops with dead time. Chemical Engineering Progress 53:217-219, 1957."
    ),
    "magill1965": (
        "D. T. Magill. Optimal adaptive estimation of sampled stochastic processes. "
        "IEEE Transactions on Automatic Control 10:434-439, 1965."
    ),
    "astrom2006": "K. J. Astrom and T. Hagglund. Advanced PID Control. ISA, 2006.",
    "caldag2020": (
        "H. O. Caldag and S. Yesilyurt. Steering control of magnetic helical swimmers in swirling flows due to "
        "confinement. IEEE International Conference on Robotics and Automation, 2020."
    ),
    "mohammadi2021": (
        "A. Mohammadi and M. W. Spong. Integral line-of-sight path following control of magnetic helical microswimmers "
        "subject to step-out frequencies. Automatica 109554, 2021."
    ),
    "tsypkin1984": "Y. Z. Tsypkin. Relay Control Systems. Cambridge University Press, 1984.",
    "honda1996": (
        "T. Honda, K. I. Arai and K. Ishiyama. Micro swimming mechanisms propelled by external magnetic fields. "
        "IEEE Transactions on Magnetics 32:5085-5087, 1996."
    ),
    "darnton2007": (
        "N. C. Darnton, L. Turner, S. Rojevsky and H. C. Berg. On torque and tumbling in swimming Escherichia coli. "
        "Journal of Bacteriology 189:1756-1764, 2007."
    ),
    "chattopadhyay2006": (
        "S. Chattopadhyay, R. Moldovan, C. Yeung and X. L. Wu. Swimming efficiency of bacterium Escherichia coli. "
        "Proceedings of the National Academy of Sciences 103:13712-13717, 2006."
    ),
    "gabrielli1950": (
        "G. Gabrielli and T. von Karman. What price speed? Specific power required for propulsion of vehicles. "
        "Mechanical Engineering 72:775-781, 1950."
    ),
    "perrin1934": (
        "F. Perrin. Mouvement brownien d'un ellipsoide (I). Journal de Physique et le Radium 5:497-511, 1934; "
        "(II) 7:1-11, 1936."
    ),
    "happel1983": "J. Happel and H. Brenner. Low Reynolds Number Hydrodynamics. Martinus Nijhoff, 1983.",
    "cortez2001": (
        "R. Cortez. The method of regularized Stokeslets. SIAM Journal on Scientific Computing 23:1204-1225, 2001."
    ),
    "cortez2012": (
        "R. Cortez and M. Nicholas. Slender body theory for Stokes flows with regularized forces. "
        "Communications in Applied Mathematics and Computational Science 7:33-62, 2012."
    ),
    "pozrikidis1992": (
        "C. Pozrikidis. Boundary Integral and Singularity Methods for Linearized Viscous Flow. "
        "Cambridge University Press, 1992."
    ),
    "dagan1982": (
        "Z. Dagan, S. Weinbaum and R. Pfeffer. An infinite-series solution for the creeping motion through an orifice "
        "of finite length. Journal of Fluid Mechanics 115:505-523, 1982."
    ),
    "rodenborn2013": (
        "B. Rodenborn, C.-H. Chen, H. L. Swinney, B. Liu and H. P. Zhang. Propulsion of microorganisms by a helical "
        "flagellum. Proceedings of the National Academy of Sciences 110:E338-E347, 2013."
    ),
    "lisevich2024": (
        "I. Lisevich, R. Colin, H. Y. Yang, B. Ni and V. Sourjik. Physics and physiology determine strategies of "
        "bacterial investment in flagellar motility. bioRxiv, doi:10.1101/2024.03.30.587422, 2024; Nature "
        "Communications, doi:10.1038/s41467-025-56980-x, 2025."
    ),
    "djutanta2023": (
        "F. Djutanta, P. T. Brown and others. Microscopic motility of isolated E. coli flagella. arXiv:2208.13854, "
        "2022; Proceedings of the National Academy of Sciences 120:e2220033120, 2023 (under another title)."
    ),
    "purcell1997": (
        "E. M. Purcell. The efficiency of propulsion by a rotating flagellum. "
        "Proceedings of the National Academy of Sciences 94:11307-11311, 1997."
    ),
    "das2018": (
        "D. Das and E. Lauga. Computing the motor torque of Escherichia coli. Soft Matter, 2018 (arXiv:1806.09694)."
    ),
    "magariyama1995": (
        "Y. Magariyama and others. Simultaneous measurement of bacterial flagellar rotation rate and swimming speed. "
        "Biophysical Journal 69:2154-2162, 1995."
    ),
    "martinez2014": (
        "V. A. Martinez, J. Schwarz-Linek, M. Reufer, L. G. Wilson, A. N. Morozov and W. C. K. Poon. Flagellated "
        "bacterial motility in polymer solutions. Proceedings of the National Academy of Sciences 111:17771-17776, "
        "2014."
    ),
    "caldag2019": (
        "H. O. Caldag and S. Yesilyurt. Trajectories of magnetically-actuated helical swimmers in cylindrical channels "
        "at low Reynolds numbers. Journal of Fluids and Structures 90:164-176, 2019."
    ),
    "liu2014": (
        "B. Liu, K. S. Breuer and T. R. Powers. Propulsion by a helical flagellum in a capillary tube. "
        "Physics of Fluids 26:011701, 2014 (cited from memory)."
    ),
    "temel2013": (
        "F. Z. Temel and S. Yesilyurt. Simulation-based analysis of micro-robots swimming at the center and near the "
        "wall of circular mini-channels. Microfluidics and Nanofluidics 14:287-298, 2013 (cited from memory)."
    ),
    "tirado1979": (
        "M. M. Tirado and J. Garcia de la Torre. Translational friction coefficients of rigid, symmetric top "
        "macromolecules. Application to circular cylinders. Journal of Chemical Physics 71:2581-2587, 1979; "
        "Rotational dynamics of rigid, symmetric top macromolecules. Application to circular cylinders. 73:1986-1993, "
        "1980."
    ),
    "higdon1979": (
        "J. J. L. Higdon. The hydrodynamics of flagellar propulsion: helical waves. "
        "Journal of Fluid Mechanics 94:331-351, 1979."
    ),
    "duchon1977": (
        "J. Duchon. Splines minimizing rotation-invariant semi-norms in Sobolev spaces. In: Constructive Theory of "
        "Functions of Several Variables, Lecture Notes in Mathematics 571:85-100, 1977."
    ),
    "owen1997": (
        "A. B. Owen. Monte Carlo variance of scrambled net quadrature. "
        "SIAM Journal on Numerical Analysis 34:1884-1910, 1997."
    ),
    "clopper1934": (
        "C. J. Clopper and E. S. Pearson. The use of confidence or fiducial limits illustrated in the case of the "
        "binomial. Biometrika 26:404-413, 1934."
    ),
    "haimes1971": (
        "Y. Y. Haimes, L. S. Lasdon and D. A. Wismer. On a bicriterion formulation of the problems of integrated "
        "system identification and system optimization. "
        "IEEE Transactions on Systems, Man, and Cybernetics 1:296-297, 1971."
    ),
    "iec60851": "IEC 60851-3. Winding wires, test methods, part 3: mechanical properties (mandrel winding test).",
    "nelder1965": (
        "J. A. Nelder and R. Mead. A simplex method for function minimization. The Computer Journal 7:308-313, 1965."
    ),
    "storn1997": (
        "R. Storn and K. Price. Differential evolution, a simple and efficient heuristic for global optimization over "
        "continuous spaces. Journal of Global Optimization 11:341-359, 1997."
    ),
}
"""Key to full reference."""

_SOFTWARE = "The Spirillum developers. spirillum, version {version}."


def citation(result: object = None) -> str:
    """The references that a result rests on, one a line; the software itself comes first.

    Args:
        result: a `Prediction`, `Resistance`, dataset, model or robot with references of its own; a model's
            name; None for the software and its paper.

    Raises:
        InputError: if the object carries no references.
    """
    keys = list(dict.fromkeys(("biorob2012", *_keys_of(result))))
    return "\n".join([_SOFTWARE.format(version=own_version()), *(REFERENCES[key] for key in keys)])


def _keys_of(result: object) -> Iterable[str]:
    if result is None:
        return ()
    if isinstance(result, str):
        return find_model(result).references
    found = getattr(result, "references", None)
    if found is None:
        found = getattr(result, "attrs", {}).get("references")
    if isinstance(found, str):
        found = found.split()
    if found is None:
        raise InputError(
            f"a {type(result).__name__} carries no references; allowed: an answer, a dataset or a model's name"
        )
    return [key for key in found if key in REFERENCES]
