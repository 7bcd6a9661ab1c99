"""Every formula a second time: plain NumPy, angles and trigonometry, one pair of directions at a time, one channel."""

import numpy as np

PI = np.pi


def pos(x):
    return max(0.0, x)


def unit(a):
    return np.asarray(a, float) / np.linalg.norm(a)


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)


def lambert(rho, n, l, v):
    return rho / PI * pos(n @ l)


def phong(k_d, k_s, m, n, l, v, halfway=False, weight=lambda cosine: 1.0):
    if n @ l <= 0:
        return 0.0
    s = pos(n @ unit(l + v)) ** m if halfway else pos((2 * (n @ l) * n - l) @ v) ** m
    return k_d * (n @ l) + k_s * s * weight(n @ l)


def fresnel(eta, c):
    g = np.sqrt(max(0.0, eta**2 + c**2 - 1))
    return 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)


def conductor_fresnel(eta, k, c):
    """The amplitudes of Fresnel's equations, complex, by Snell's law."""
    index = complex(eta, -k)
    transmitted = np.sqrt(1 - (1 - c**2) / index**2)
    across = (c - index * transmitted) / (c + index * transmitted)
    within = (index * c - transmitted) / (index * c + transmitted)
    return (abs(across) ** 2 + abs(within) ** 2) / 2


def reflectance(eta, k, c):
    return conductor_fresnel(eta, k, c) if k else fresnel(eta, c)


def cook_torrance(rho, k_s, eta, n, l, v, distribution, book=False, colour=None, k=None):
    """`eta` and the result are RGB; `distribution(h)` is D."""
    nl, nv = n @ l, n @ v
    if nl <= 0:
        return np.zeros(3)
    out = np.full(3, (1 - k_s) * rho / PI * nl)
    if nv <= 0:
        return out
    h = unit(l + v)
    nh, vh = n @ h, v @ h
    g = min(1.0, 2 * nh * nv / vh, 2 * nh * nl / vh)
    indices = [*zip(eta, k or (0, 0, 0), strict=True)]
    f = np.array([reflectance(*index, vh) for index in indices])
    if colour is not None:
        f0 = np.array([reflectance(*index, 1.0) for index in indices])
        f = (colour + (1 - colour) * np.maximum(0, f - f0) / (1 - f0)) * f.mean()
    return out + nl * k_s * distribution(h) * g * f / ((1 if book else 4) * PI * nl * nv)


def slopes(n, g, h):
    """tan²θ cos²φ and tan²θ sin²φ of h, φ from g."""
    theta, b = angle(n, h), np.cross(n, g)
    phi = np.arctan2(h @ b, h @ g)
    return (np.tan(theta) * np.cos(phi)) ** 2, (np.tan(theta) * np.sin(phi)) ** 2


def ward(k_d, k_s, m_x, m_y, n, l, v, g, form):
    nl, nv = n @ l, n @ v
    if nl <= 0:
        return 0.0
    if nv <= 0:
        return k_d / PI * nl
    h, sum_ = unit(l + v), l + v
    x, y = slopes(n, g, h)
    lobe = np.exp(-x / m_x**2 - y / m_y**2) / (4 * PI * m_x * m_y)
    if form == "bounded":
        lobe *= 4 * (sum_ @ sum_) / (sum_ @ n) ** 4
    else:
        lobe /= np.sqrt(nl * nv) if form == "ward" else nl * nv
    return (k_d / PI + k_s * lobe) * nl


def ashikhmin_shirley(rho, r_s, n_u, n_v, n, l, v, g):
    nl, nv = n @ l, n @ v
    if nl <= 0 or nv <= 0:
        return 0.0
    h = unit(l + v)
    x, y = slopes(n, g, h)
    power = (n_u * x + n_v * y) / (x + y)
    f = r_s + (1 - r_s) * (1 - h @ l) ** 5
    lobe = np.sqrt((n_u + 1) * (n_v + 1)) / (8 * PI) * (n @ h) ** power * f / ((h @ l) * max(nl, nv))
    body = 28 * rho / (23 * PI) * (1 - r_s) * (1 - (1 - nl / 2) ** 5) * (1 - (1 - nv / 2) ** 5)
    return (body + lobe) * nl


def kirchhoff_series(g, t):
    """S = g Σ gʲ e⁻ᵍ/(j! j) e^(−g t/j), as many terms as count."""
    j = np.arange(1, int(g + 20 * np.sqrt(g)) + 200)
    logarithms = np.cumsum(np.log(g) - np.log(j)) - g
    return g * np.sum(np.exp(logarithms - g * t / j) / j)


def kajiya(sigma, t_x, t_y, wavelengths, eta, n, l, v, g, form):
    nl, nv = n @ l, n @ v
    if nl <= 0 or nv <= 0:
        return np.zeros(3)
    h = unit(l + v)
    m_x, m_y = 2 * sigma / t_x, 2 * sigma / t_y
    x, y = slopes(n, g, h)
    attenuation = min(1.0, 2 * (n @ h) * nv / (v @ h), 2 * (n @ h) * nl / (v @ h))
    out = []
    for wavelength, index in zip(wavelengths, eta, strict=True):
        k = 2 * PI / wavelength
        g_ = (k * sigma * (nl + nv)) ** 2
        f = fresnel(index, v @ h) * attenuation * kirchhoff_series(g_, x / m_x**2 + y / m_y**2)
        f /= 4 * nl * nv * PI * m_x * m_y * (n @ h) ** 4
        if form == "conserving":
            f *= (1 - np.exp(-((2 * k * sigma * min(nl, nv)) ** 2))) / (1 - np.exp(-g_))
        out.append(f * nl)
    return np.array(out)


def beckmann(n, m):
    def density(h):
        a = angle(n, h)
        return np.exp(-((np.tan(a) / m) ** 2)) / (m**2 * np.cos(a) ** 4)

    return density


def elliptical(n, g, m1, m2):
    def density(h):
        a = angle(n, h)
        p = np.arctan2(h @ np.cross(n, g), h @ g)
        return np.exp(-(np.tan(a) ** 2) * ((np.cos(p) / m1) ** 2 + (np.sin(p) / m2) ** 2)) / (m1 * m2 * np.cos(a) ** 4)

    return density


def gaussian(n, m, c):
    return lambda h: c * np.exp(-((angle(n, h) / m) ** 2))


def oren_nayar(rho, sigma, n, l, v):
    if n @ l <= 0:
        return 0.0
    ti, tr = angle(n, l), angle(n, v)
    a, b = max(ti, tr), min(ti, tr)
    x, y = l - (n @ l) * n, v - (n @ v) * n
    cos_delta = np.cos(angle(x, y))
    s2 = sigma**2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    c2 = 0.45 * s2 / (s2 + 0.09) * (np.sin(a) - (0 if cos_delta >= 0 else (2 * b / PI) ** 3))
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * a * b / PI**2) ** 2
    bracket = c1 + c2 * cos_delta * np.tan(b) + c3 * (1 - abs(cos_delta)) * np.tan((a + b) / 2)
    l1 = rho / PI * np.cos(ti) * bracket
    l2 = 0.17 * rho**2 / PI * np.cos(ti) * s2 / (s2 + 0.13) * (1 - cos_delta * (2 * b / PI) ** 2)
    return pos(l1 + l2)


def strauss_f(x, k=1.12):
    return (1 / (x - k) ** 2 - 1 / k**2) / (1 / (1 - k) ** 2 - 1 / k**2)


def strauss_g(x, k=1.01):
    return (1 / (1 - k) ** 2 - 1 / (x - k) ** 2) / (1 / (1 - k) ** 2 - 1 / k**2)


def strauss(c, s, m, t, n, l, v):
    if n @ l <= 0:
        return 0.0
    xi, xr = 2 * angle(n, l) / PI, min(1.0, 2 * angle(n, v) / PI)
    r_d = (1 - s**3) * (1 - t)
    r_n = 1 - t - r_d
    q_d = (n @ l) * (1 - m * s) * r_d * c
    r_j = min(1.0, r_n + (r_n + 0.1) * strauss_f(xi) * strauss_g(xi) * strauss_g(xr))
    r_s = pos((2 * (n @ l) * n - l) @ v) ** (3 / (1 - s)) * r_j
    return q_d + r_s * (1 + m * (1 - strauss_f(xi)) * (c - 1))


def cylinders(k_d, k_s, m, spacing, floor, n, l, v, g, count=20_000):
    """Poulin–Fournier by brute force: pieces of one period, each tested against the circles of its neighbours."""
    b = np.cross(n, g)
    middle = (np.arange(count) + 0.5) / count
    cap = np.arccos(max(floor, np.sqrt(max(0.0, 1 - spacing**2 / 4))))
    theta = cap * (2 * middle - 1)
    x = np.concatenate([np.sin(theta), np.sin(cap) + (spacing - 2 * np.sin(cap)) * middle])
    z = np.concatenate([np.cos(theta), np.full(count, np.cos(cap))])
    area = np.concatenate([np.full(count, 2 * cap / count), np.full(count, (spacing - 2 * np.sin(cap)) / count)])
    on_cap = np.arange(2 * count) < count
    facet = np.where(on_cap, x, 0.0)[:, None] * b + np.where(on_cap, z, 1.0)[:, None] * n

    def reached(w):
        across, rise = w @ b, w @ n
        free = facet @ w > 0
        last = 40  # farther than across / rise the ray is above all circles
        if rise > 0:
            last = int(min(40, (abs(across) / rise + 1) / spacing + 1.5))
        for k in range(-last, last + 1):
            # where the ray (x, z) + s (across, rise) leaves circle k, it may not stand above the floor
            px = x - k * spacing
            aa, bb, cc = across**2 + rise**2, px * across + z * rise, px**2 + z**2 - 1
            disc = bb**2 - aa * cc
            far = (-bb + np.sqrt(np.maximum(disc, 0))) / aa
            free &= (on_cap & (k == 0)) | (disc <= 0) | (far <= 1e-9) | (z + far * rise <= np.cos(cap))
        return free

    both = reached(l) & reached(v)
    h = unit(l + v)
    value = k_d * np.maximum(0, facet @ l) + k_s * np.maximum(0, facet @ h) ** m
    return np.sum(value * np.maximum(0, facet @ v) * area * both) / (spacing * (n @ v))
