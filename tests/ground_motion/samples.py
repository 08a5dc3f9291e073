"""Files of every format that tdint reads with its own readers, by the name of the format."""

from ground_motion import format_files as files
from ground_motion import network_files as networks

SAMPLES = {
    "AFAD": (networks.afad,),
    "AT2": (files.at2, files.free_at2),
    "BHRC": (networks.bhrc,),
    "COSMOS": (files.cosmos,),
    "CSMIP": (files.csmip_v1, files.csmip_v2, files.csmip_pairs),
    "CSMNC": (networks.csmnc,),
    "CWB": (networks.cwb,),
    "ESM": (files.esm,),
    "GEONET": (files.geonet, lambda: files.geonet(volume=1)),
    "SACTEXT": (files.sac_text,),
    "SMC": (files.smc, lambda: files.commented(files.smc())),
    "TEXT": (
        files.one_column,
        files.two_columns,
        lambda: files.two_columns(header=None, separator="  "),
    ),
    "UNAM": (networks.unam,),
    "USC": (files.usc, files.usc_2, lambda: files.usc_2(line_first=True)),
}
"""Functions that write files of each format."""
