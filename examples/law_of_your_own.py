"""A law of one's own: fibres along one direction that resist stretch linearly, W = E/8 (I4 − 1)² for I4 > 1."""

import numpy as np

import fibrous as fb


class StraightFibers(fb.Material):
    """P_iJ = E/2 x a_i N_J and A_iJkL = E/2 x δ_ik N_J N_L + E a_i N_J a_k N_L with a = F N, x = a · a − 1 > 0."""

    def __init__(self, modulus_MPa, direction):
        self.modulus_MPa, self.N = modulus_MPa, np.asarray(direction, dtype=float)

    def __call__(self, gradient, state=None, near=None):
        a = gradient @ self.N
        x = np.maximum((a * a).sum(-1) - 1.0, 0.0)[..., None, None]
        aN = a[..., :, None] * self.N
        stiff = (x > 0.0)[..., None, None] * aN[..., None, None] * aN[..., None, None, :, :]
        turned = x[..., None, None] * np.einsum("ik,J,L->iJkL", np.eye(3), self.N, self.N)
        return 0.5 * self.modulus_MPa * x * aN, self.modulus_MPa * (0.5 * turned + stiff), state

    def energy(self, gradient):
        a = gradient @ self.N
        return self.modulus_MPa / 8.0 * np.maximum((a * a).sum(-1) - 1.0, 0.0) ** 2

    def of_elements(self, elements):
        return self  # the same in all elements


def main():
    law = fb.NeoHookean(C1=0.025, lame_lambda=0.417) + StraightFibers(0.5, [1.0, 0.0, 0.0])
    F = np.diag([1.1, 0.97, 0.97])
    solution = fb.solve(fb.Slab(elements=(6, 7, 1)).specimen(steps=5), law)
    print(f"σ_xx at a stretch of 1.1: {1000.0 * law.stress(F)[0, 0]:.1f} kPa")
    print(solution)
    print(f"force along x: {solution.reaction[-1, 1, 0]:.3f} N")
    return law, solution


if __name__ == "__main__":
    main()
