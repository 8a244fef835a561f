"""pyFRF's times for H1 and coherence, s, as one JSON document on stdout."""

import json
import sys

import numpy as np
import pyFRF

from stopwatch import times


def spectra(hits, responses, samples):
    rng = np.random.default_rng(1)
    force = rng.standard_normal((hits, 1, samples))
    response = rng.standard_normal((hits, responses, samples))

    def job():
        frf = pyFRF.FRF(51200, force, response, exc_type="f", resp_type="v", copy=False)
        frf.get_H1()
        frf.get_coherence()

    return times(job)


print(json.dumps({"seconds": spectra(**json.loads(sys.argv[1]))}))
