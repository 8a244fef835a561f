"""pyFBS's side of the parity check: argv[1] is a JSON object with `data` (our test data), `folder` (where the answer goes) and `weights`."""

import json
import os
import sys

import numpy as np
import pandas as pd
from pyfbs.expansion import semm
from pyfbs.interface import VPT
from pyfbs.utility import tpinv

job = json.loads(sys.argv[1])
sheets = pd.read_excel(os.path.join(job["data"], "positions", "positions.xlsx"), sheet_name=None)
answer = {}


def read(case, name):
    return np.load(os.path.join(job["data"], case, f"{name}.npz"))


def of_groups(sheet, groups):
    return sheet[sheet.Grouping.isin(groups)]


def keep(name, vpt):
    answer.update({f"{name}_tu": vpt.tu, f"{name}_tf": vpt.tf, f"{name}_y": vpt.frf})


def virtual_points(name, groups, channels=None, **weights):
    file = read("frf_rigid", name)
    vpt = VPT(
        sheets[f"Channels_{name}"], sheets[f"Impacts_{name}"],
        of_groups(sheets["VP_Channels"], groups) if channels is None else channels,
        of_groups(sheets["VP_RefChannels"], groups), **weights)
    vpt.apply_vpt(file["frequency"], file["frf"])
    return vpt


for name, groups in (("A", [1]), ("B", [2]), ("AJB", [1, 2])):
    vpt = virtual_points(name, groups)
    keep(name, vpt)
    for group in groups:
        vpt.consistency([group], [group])
        for what in ("overall_sensor", "overall_impact", "specific_sensor", "specific_impact"):
            answer[f"{name}_{group}_{what}"] = getattr(vpt, what)

weights = np.diag(job["weights"])
keep("weighted", virtual_points("A", [1], wu=weights, wf=weights))
extension = of_groups(sheets["VP_Channels"], [1]).iloc[[0]].copy()
extension["Description"] = "ex"
flexible = pd.concat([of_groups(sheets["VP_Channels"], [1]), extension])
keep("flexible", virtual_points("A", [1], channels=flexible))

parent, overlay = read("frf_rigid", "A"), read("frf_default", "A")
y_num = parent["frf"] / (2j * np.pi * parent["frequency"])[:, None, None]
outputs = [list(parent["outputs"]).index(n) for n in job["semm_outputs"]]
inputs = [list(parent["inputs"]).index(n) for n in job["semm_inputs"]]
# half as much again, so that the correction is as large as the parent
y_exp = 1.5 * overlay["frf"][:, outputs][:, :, inputs]
channels, impacts = sheets["Channels_A"], sheets["Impacts_A"]


def mixed(kind, **drops):
    return semm(y_num, y_exp, channels, impacts, channels.iloc[outputs], impacts.iloc[inputs], semm_type=kind, **drops)


answer["semm_basic"] = mixed("basic")
answer["semm_extended"] = mixed("fully-extend")
# what pyFBS calls truncated is not: its branch is never reached
answer["semm_svd"] = mixed("fully-extend-svd", red_comp=2, red_eq=1)
# the formula of that branch, with its own truncated inverse
answer["semm_truncated"] = y_num - y_num @ tpinv(y_num[:, outputs, :], trunc=2) @ (
    y_num[:, outputs][:, :, inputs] - y_exp) @ tpinv(y_num[:, :, inputs], trunc=1) @ y_num
np.savez(os.path.join(job["folder"], "pyfbs.npz"), **answer)
