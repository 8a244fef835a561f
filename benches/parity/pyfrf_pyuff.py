"""The peers' side of the parity check: argv[1] is the folder that pyfrf_pyuff.rs has filled and reads afterwards."""

import json
import os
import sys

import numpy as np
import pyFRF
import pyuff

folder = sys.argv[1]


def spectra():
    """Largest differences between our estimates and pyFRF's, without 0 Hz, where pyFRF takes the mean away after the windows."""
    records = np.load(os.path.join(folder, "records.npz"))
    ours = np.load(os.path.join(folder, "ours.npz"))
    peer = pyFRF.FRF(int(records["fs"]), records["force"], records["response"], exc_type="f", resp_type="v")
    differences = {}
    for name, array in (("H1", "frf"), ("H2", "h2"), ("Hv", "hv")):
        theirs = peer.get_FRF(name, frf_form="mobility")[:, 0, 1:]
        mine = ours[array][1:, :, 0].T
        size = np.maximum(np.abs(theirs), np.mean(np.abs(theirs)))
        differences[name] = float(np.max(np.abs(theirs - mine) / size))
    differences["coherence"] = float(np.max(np.abs(peer.get_coherence()[:, 1:] - ours["coherence"][1:].T)))
    return differences


def plain(value):
    """For JSON; floats as text, because every digit counts."""
    if isinstance(value, np.ndarray):
        if np.iscomplexobj(value):
            return {"re": plain(value.real), "im": plain(value.imag)}
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


def write_theirs():
    """A file of every function type, text and binary, real and complex, even and uneven, and all other sets; and what was meant."""
    path = os.path.join(folder, "theirs.uff")
    rng = np.random.default_rng(3)
    file, meant = pyuff.UFF(path), []

    def add(dset, **options):
        keep = dict(dset)
        file.write_sets(dset, mode="add", **options)
        meant.append(plain(keep))

    for kind in (0, 1, 2, 3, 4, 6, 9):
        for binary in (0, 1):
            for even in (0, 1):
                for is_complex in (False, True):
                    n = 11
                    x = 5.0 + 0.25 * np.arange(n) if even else np.round(np.cumsum(rng.random(n)), 3)
                    data = rng.standard_normal(n) * 10.0 ** rng.integers(-9, 9, n)
                    if is_complex:
                        data = data + 1j * rng.standard_normal(n)
                    add(pyuff.prepare_58(
                        binary=binary, func_type=kind, rsp_node=12, rsp_dir=-2, ref_node=101, ref_dir=3, data=data, x=x,
                        id1="parity", rsp_ent_name="A1", ref_ent_name="AZ1", abscissa_spacing=even,
                        abscissa_spec_data_type=18, ordinate_spec_data_type=12, orddenom_spec_data_type=13))
    nodes = dict(node_nums=[1, 2, 30], def_cs=[0, 0, 1], disp_cs=[0, 1, 1], color=[1, 2, 3],
                 x=[0.0, 1.5, -2.25], y=[1e-3, 0.0, 2.0], z=[3.0, -4.0, 0.0])
    add(pyuff.prepare_15(**nodes))
    add(pyuff.prepare_2411(**nodes))
    add(pyuff.prepare_82(trace_num=3, color=5, id="outline", nodes=np.array([1, 2, 30, 0, 1, 7, 8, 9, 10])))
    add(pyuff.prepare_151(
        model_name="model", description="what it is", db_app="app", date_db_created="27-Jan-16", time_db_created="14:38:15",
        version_db1=1, version_db2=2, file_type=0, date_db_saved="28-Jan-16", time_db_saved="14:38:16", program="pyuff"))
    add(pyuff.prepare_164(units_code=1, units_description="SI", temp_mode=1, length=3.28083989501312334,
                          force=2.24808943099710480e-01, temp=1.8, temp_offset=459.67))
    element = dict(element_nums=1, fe_descriptor=44, phys_table=1, mat_table=2, color=3, num_nodes=4, nodes_nums=[1, 2, 30, 4])
    beam = dict(element, element_nums=2, fe_descriptor=11, num_nodes=2, nodes_nums=[1, 2],
                beam_orientation=0, beam_foreend_cross=1, beam_aftend_cross=1)
    add({"type": 2412, 44: [element], 11: [beam]})
    return meant


ours = pyuff.UFF(os.path.join(folder, "ours.uff")).read_sets()
json.dump(
    {"spectra": spectra(), "ours": [plain(s) for s in ours], "theirs": write_theirs()},
    open(os.path.join(folder, "answer.json"), "w"),
)
