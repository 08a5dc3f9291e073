"""Real records are read correctly if TDINT_RECORDS is set to a directory that contains them.

The expected peaks are stated in the headers of the files or by their publishers.
"""

import pytest

from real_records import real_file
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.reading.read import read_records
from tdint.units import STANDARD_GRAVITY

RECORDS = [
    ("0111a.smc", 0.005, (6001,), (1.044078,)),
    ("017m30cc.y0a", 0.001, (31027,), (3.985,)),
    ("2-ECU.dat", 0.02, (6000,) * 3, (0.01196, 0.02931, 0.02811)),
    ("20170720223109_0921.txt", 0.01, (28683,) * 3, (0.13200332, 0.12163827, 0.09840572)),
    ("5526-1.V1", 0.005, (9472,) * 3, (0.058010061277, 0.063749697389, 0.12942032138)),
    ("CUP50401.012", 0.004, (17500,) * 3, (0.0047, 0.01189, 0.01216)),
    ("20190706031952.CJ.T001230.HNE.sac", 0.02, (15001,), (0.42545171,)),
    ("20190706031952.CJ.T001230.HNZ.sac", 0.02, (15001,), (9.92604327,)),
    ("CHAN04.V2", 0.02, (1138,), (2.81104,)),
    ("CHAN08.V2", 0.02, (1138,), (3.85971,)),
    ("stgopuentealto1002271parte2.v1", 0.01, (6700,) * 3, (0.133, 0.128, 0.083)),
    ("NEWPORT.RAW", 0.001, (59999,) * 3, (0.055, 0.015, 0.043)),
    ("ce23583r_HESPERIA.RAW", 0.005, (12001,) * 3, (0.058, 0.042, 0.091)),
    ("20180212_211557_WPWS_20.V2A", 0.02, (5800,) * 3, (0.0416, 0.194, 0.0273)),
    ("AICH040010061330.EW2", 0.005, (28600,), (0.03896,)),
    ("AOM0051801241951.EW", 0.01, (9500,), (0.2907,)),
    ("AOM0051801241951.NS", 0.01, (9500,), (0.28821,)),
    ("CE89146.V1", 0.005, (13200,) * 3, (0.7765, 0.2065, 0.4441)),
    ("CI.CLC..HNE.mseed", 0.01, (39001,), (3.19,)),
    ("CI.CLC..HNN.mseed", 0.01, (39001,), (5.25,)),
    ("CI.CLC..HNZ.mseed", 0.01, (39001,), (3.78,)),
    ("Cosmos12TimeSeriesTest.v1", 0.01, (7000,), (1.61962,)),
    ("H-E01140.AT2", 0.005, (7807,), (1.368,)),
    ("RSN763_LOMAP_GIL067.AT2", 0.005, (7999,), (3.516,)),
    ("RSN763_LOMAP_GIL337.AT2", 0.005, (7999,), (3.203,)),
    ("ce36456p_CE36456.V2", 0.02, (3251, 3250, 3250), (2.67957, 0.94805, 2.56231)),
    ("elCentro1940_180.at2", 0.02, (1559,), (3.1266,)),
    ("us1000hyfh_akbmrp_AKBMR--n.1000hyfh.BNZ.--.acc.V2c", 0.005, (42000,), (0.06851512,)),
]


IN_THOUSANDTHS = ("stgopuentealto1002271parte2.v1", "NEWPORT.RAW", "ce23583r_HESPERIA.RAW")
"""Their headers state the peaks in thousandths of g."""


@pytest.mark.parametrize(
    ("name", "dt", "samples", "peaks"), RECORDS, ids=[record[0] for record in RECORDS]
)
def test_samples_interval_and_peak_of_real_records(name, dt, samples, peaks):
    path = real_file(name)
    inventory = real_file("CI.CLC.xml") if name.startswith("CI.CLC") else None
    units = "g" if name.endswith(".sac") else None
    records = read_records(path, inventory=inventory, units=units)
    assert tuple(record.acceleration.size for record in records) == samples
    assert [record.dt for record in records] == pytest.approx([dt] * len(samples), rel=1e-9)
    if inventory:
        # The published peaks of these are those after a high-pass filter as well.
        assert [record.pga for record in records] == pytest.approx(list(peaks), rel=5e-3)
        records = tuple(process(record, highpass=0.05) for record in records)
    if name in IN_THOUSANDTHS:
        assert [record.pga / STANDARD_GRAVITY for record in records] == pytest.approx(
            list(peaks), abs=5.1e-4
        )
        return
    tolerance = 2e-3 if inventory else 3e-4
    assert [record.pga for record in records] == pytest.approx(list(peaks), rel=tolerance)
    assert not any("states a peak" in note for record in records for note in record.notes)
