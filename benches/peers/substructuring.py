"""Virtual points and all methods as a numpy notebook does them; argv[1] is the npz that the bench has written. Prints seconds and k_z."""

import json
import sys

import numpy as np

from stopwatch import times

data = dict(np.load(sys.argv[1]))


def rows(kind):
    """R of the interface: e and r x e for each channel or impact."""
    position, direction = data[f"{kind}_position"], data[f"{kind}_direction"]
    return np.hstack([direction, np.cross(position, direction)])


def notebook():
    pinv, inv = np.linalg.pinv, np.linalg.inv
    s = 2j * np.pi * data["frequency"][:, None, None]
    a, b, ajb = data["a"] / s, data["b"] / s, data["ajb"] / s
    tu_a, tu_b = pinv(rows("channel_a")), pinv(rows("channel_b"))
    tf_a, tf_b = pinv(rows("impact_a")).T, pinv(rows("impact_b")).T
    out_a, out_b, in_a, in_b = (data[n].astype(int) for n in ("out_a", "out_b", "in_a", "in_b"))
    # of A alone and B alone the interface comes first
    n_oa, n_ob, n_ia, n_ib = len(out_a), len(out_b), len(in_a), len(in_b)
    y_a, y_b = tu_a @ a[:, :n_oa, :n_ia] @ tf_a, tu_b @ b[:, :n_ob, :n_ib] @ tf_b
    t_u = np.zeros((12, n_oa + n_ob))
    t_u[:6, :n_oa], t_u[6:, n_oa:] = tu_a, tu_b
    t_f = np.zeros((n_ia + n_ib, 12))
    t_f[:n_ia, :6], t_f[n_ia:, 6:] = tf_a, tf_b
    outputs, inputs = np.concatenate([out_a, out_b]), np.concatenate([in_a, in_b])
    y = t_u @ ajb[:, outputs][:, :, inputs] @ t_f
    z, w = inv(y), y_a + y_b
    found = {
        "inverse": -z[:, :6, 6:],
        "inverse-ba": -z[:, 6:, :6],
        "primal-a": z[:, :6, :6] - inv(y_a),
        "primal-b": z[:, 6:, 6:] - inv(y_b),
    }
    x = w - (y[:, :6, :6] - y[:, :6, 6:] - y[:, 6:, :6] + y[:, 6:, 6:])
    found["interface"] = inv(w @ inv(x) @ w - w)
    # all impacts on A and all responses on B count as internal, then those of groupings 3 and 4 alone
    q, p = tu_a @ a[:, :n_oa], b[:, :, :n_ib] @ tf_b
    m = ajb[:, data["all_out_b"].astype(int)][:, :, data["all_in_a"].astype(int)]
    found["internal"] = inv(inv(pinv(p) @ m @ pinv(q)) - w)
    p, q, m = p[:, n_ob:], q[:, :, n_ia:], m[:, n_ob:, n_ia:]
    found["internal-printed"] = inv(q @ inv(m) @ p - w)
    k = {name: z[:, 2, 2].real for name, z in found.items()}
    return {name: [float(v.mean()), float(v.std()), float(np.median(v))] for name, v in k.items()}


statistics = notebook()
seconds = times(notebook)
print(json.dumps({"seconds": seconds, "k_z": {name: k[0] for name, k in statistics.items()}}))
