"""Small records in the formats of `tdint.ground_motion.formats`, written by the tests.

Each function returns the text of a file. The samples have as many decimals as the format, so that
they are read exactly.
"""

import numpy as np

from tdint.ground_motion.formats.series import motion_units
from tdint.units import STANDARD_GRAVITY, parse_units


def motion(samples=120, peak=1.5, decimals=3):
    """Return a decaying sine without zero samples; its extreme sample is `peak`, which may be
    negative."""
    t = np.arange(samples)
    wave = np.sin(0.37 * t + 0.2) * np.exp(-t / samples)
    wave *= peak / wave[np.argmax(np.abs(wave))]
    return np.round(wave, decimals)


def columns(values, each, form):
    """Return rows of `each` numbers in a form of `format`."""
    texts = [format(value, form) for value in values]
    return [" ".join(texts[i : i + each]).rstrip() for i in range(0, len(texts), each)]


def fortran(values, each, width, decimals):
    """Return rows of numbers in fixed columns without a zero before the point, as Fortran writes
    them."""

    def field(value):
        text = f"{value:.{decimals}f}"
        if len(text) > width or text.startswith(("0.", "-0.")):
            text = text.replace("0.", ".", 1)
        return text.rjust(width)

    texts = [field(value) for value in values]
    return ["".join(texts[i : i + each]) for i in range(0, len(texts), each)]


def text(*parts):
    """Return lines and lists of lines as the text of a file."""
    lines = []
    for part in parts:
        lines.extend([part] if isinstance(part, str) else part)
    return "\n".join(lines) + "\n"


def at2(values=None, npts=None, step="NPTS=  {n}, DT= .00500 SEC", each=5, units="G"):
    values = motion() if values is None else values
    return text(
        "PEER NGA STRONG MOTION DATABASE RECORD",
        "Somewhere, 1/2/2003, Far Hill - Coll. #2, 067",
        f"ACCELERATION TIME SERIES IN UNITS OF {units}",
        step.format(n=len(values) if npts is None else npts),
        columns(values, each, "15.7E"),
    )


def free_at2():
    """Return a file with free lines before NPTS and words after the values."""
    return text(
        "Some motion, 1940",
        "120 points at equal spacing of 0.02 sec",
        "The units are (g)",
        "*** Begin data ***",
        "NPTS=  120, DT= .02000 SEC",
        columns(motion(), 8, "9.5f"),
        "*** End Data ***",
        "",
    )


def cosmos(
    values=None,
    units="cm/sec2(04)",
    quantity="acceleration",
    codes=True,
    npts=None,
    blocks=None,
    channel="1: 340",
):
    """Return one channel of COSMOS 1.20, volume 2; `blocks` contains quantities and values that
    follow the first block."""
    values = motion() if values is None else values
    integers, reals = [-999] * 100, [-999.0] * 100
    integers[:4], integers[39:45] = [2, 1, 4, 120], [2005, 167, 6, 16, 20, 53]
    reals[29], reals[61], reals[62] = 4.4, 10.0, len(values) * 0.01
    # The maximum is in cm/sec2 for any units of the samples.
    known = motion_units(units) or {"7": "0.0254 m/s^2", "2": "g"}.get(units[-2:-1])
    peak = np.max(np.abs(values)) * (parse_units(known).scale / 0.01 if known else 1.0)
    comments = ["| <SCNL>FAR.HNE.XX.10    <AUTH> 2019/02/01"] if codes else ["| nothing"]
    width = 8 if units.startswith("counts") else 10
    form = "(10I8)" if units.startswith("counts") else "(8F10.5)"
    body = []
    for name, data in [(quantity, values), *(blocks or [])]:
        body.append(
            f"   {npts or len(data)} {name} pts, approx   {round(len(data) * 0.01)} secs, "
            f"units={units},Format={form}"
        )
        body += fortran(data, 8, width, 0 if width == 8 else 5)
        units = "cm/sec(05)"
    return text(
        "Corrected acceleration    (Format v01.20 with 13 text lines) Src: test",
        "Record of Somewhere",
        ["Hypocenter:", "Origin:"],
        "Statn No: 01-23075  Code:CE-J2236  Somewhere",
        ["Coords:", "Recorder:"],
        "Rcrd start time:06/16/2005, 20:53:04.400 UTC (Q=2) RcrdId: none",
        f"Sta Cha:  {channel} deg (Rcrdr Chan  1) Location: none",
        "Raw record length = 1 sec",
        f"Processed: 06/17/2005, 12:01:00 PDT      Max =  {peak:.3f} cm/sec2  at  27.850 sec",
        "Record filtered",
        "Values used when parameter or data value is unknown/unspecified:   -999, -999.0",
        " 100 Integer-header values follow on  10 lines, Format= (10I8)",
        ["".join(f"{value:8d}" for value in integers[i : i + 10]) for i in range(0, 100, 10)],
        " 100 Real-header values follow on  17 lines, Format= (6F13.6)",
        fortran(reals, 6, 13, 6),
        f'  {len(comments)} Comment line(s) follow, each starting with a "|":',
        comments,
        body,
        "/&  ----------  End of data for channel  1  ----------",
    )


INTEGER_ROWS = ["    1" * 16] * 6 + ["    0" * 4]


def csmip_texts(title, number, azimuth, more):
    return [
        f"{title}   36456-S4384-83123.01       CHAN  {number}: {azimuth}",
        "SOME EARTHQUAKE",
        "36456-S4384-83123.01               TRIGGER TIME: 05/02/83, 16:42:48.2 PDT",
        "STATION NO. 36456   35.908N, 120.458W     SMA-1  S/N 4384",
        f"CHAN  {number}: {azimuth}",
        *more,
    ]


def csmip_v2(
    components=None, data="{n} POINTS OF {kind} DATA EQUALLY SPACED AT  .020 SEC.  (UNITS: {units})"
):
    """Return channels with acceleration, velocity and displacement."""
    body = []
    for number, (azimuth, peak) in enumerate(
        (components or {" 90 DEG": 150.5, "UP": -75.25}).items(), start=1
    ):
        values = motion(peak=peak)
        body += csmip_texts(
            "CORRECTED ACCELEROGRAM",
            number,
            azimuth,
            [
                "                        UNCOR MAX  =  -.275 G, AT  10.947 SEC.",
                f"  {len(values)} POINTS OF INSTRUMENT- AND BASELINE-CORRECTED ACCEL, VELOC AND "
                "DISPL DATA",
                "AT EQUALLY-SPACED INTERVALS OF    .020  SEC.",
                f"PEAK ACCELERATION =  {peak:.3f}    CM/SEC/SEC  AT   10.940   SEC.",
            ],
        )
        body += INTEGER_ROWS + fortran([0.041] * 100, 8, 10, 3)
        for quantity, units in (("ACCEL", "CM/SEC/SEC"), ("VELOC", "CM/SEC"), ("DISPL", "CM")):
            body.append(" " + data.format(n=len(values), kind=quantity, units=units))
            body += fortran(values if quantity == "ACCEL" else values / 2, 8, 10, 3)
        body.append(f"/&  ----------  END OF DATA FOR CHANNEL  {number}  ----------")
    return text(body)


def csmip_v1(components=None):
    """Return channels of equally spaced accelerations in g."""
    body = []
    for number, (azimuth, peak) in enumerate(
        (components or {"360 Deg": 0.125, " Up": -0.5}).items(), start=1
    ):
        values = motion(peak=peak)
        body += csmip_texts("Uncorrected Accelerogram Data", number, azimuth, [
            f"No. of Points =  {len(values)}  Record Length = 66.000 sec   at 200 Samples/sec",
            f"Units of uncor data are sec and g .        Max  =   {peak:.3f} g , at  30.590 sec.",
        ])  # fmt: skip
        body += INTEGER_ROWS + fortran([-999.0] * 50, 8, 10, 5)
        body.append(
            f" {len(values)} Accelerogram points at 200 pts/sec in units of g .      Format: "
            "(8f9.6)"
        )
        body += fortran(values, 8, 9, 6)
        body.append(f"/&  ----------  End of Data for Channel  {number}  ----------")
    return text(body)


def pairs(values, dt, times=None):
    """Return pairs of time and value in the format 10F7.3."""
    times = np.arange(len(values)) * dt if times is None else times
    return fortran(np.column_stack([times, values]).ravel(), 10, 7, 3)


def csmip_pairs(values=None, dt=0.005, times=None, units="G/10"):
    """Return one channel of pairs of time and acceleration, as digitized from film."""
    values = motion() if values is None else values
    # The maximum is in g, but the samples are in tenths of g.
    peak = np.max(np.abs(values)) * parse_units(motion_units(units) or "g").scale / STANDARD_GRAVITY
    texts = csmip_texts("UNCORRECTED ACCELEROGRAM DATA", 1, " 90 DEG", [
        f"NO. OF POINTS =  {len(values)}  RECORD LENGTH = 59.998 SEC",
        f"UNITS OF UNCOR ACCEL ARE SEC AND {units}.     MAX  =  -{peak:.3f} G, AT  11.576 SEC.",
    ])  # fmt: skip
    return text(texts, INTEGER_ROWS, fortran([0.04] * 50, 8, 10, 3), pairs(values, dt, times))


def usc(values=None, dt=0.005, times=None):
    values = motion() if values is None else values
    return text(
        "FILE     0 OF UNCORRECTED ACCELEROGRAM DATA OF VOLUME I:",
        "SOME EARTHQUAKE                                                         21",
        "STATION USC# 0057   34 25 09N, 118 25 34W                               39",
        "COMP N00W                                                               9",
        f"NO. OF POINTS =   {len(values)}      DURATION =  31.026 SEC                      50",
        "UNITS ARE SEC AND G/10                                                  22",
        INTEGER_ROWS,
        fortran([0.04] * 50, 8, 10, 3),
        [" " + line for line in pairs(values, dt, times)],
    )


def usc_2(values=None, count=None, peak=None, blocks=("ACC", "VEL", "DIS"), line_first=False):
    """Volume 2: the header states the units of volume 1, and the peak has the units of the samples.
    With `line_first`, the line of the acceleration is above the integers and reals."""
    values = motion(peak=150.5) if values is None else values
    lines = [
        f"{len(values) if count is None else count:6d} POINTS OF {word} DATA EQUALLY SPACED AT   "
        ".010 SEC."
        for word in blocks
    ]
    header = [INTEGER_ROWS, fortran([0.04] * 100, 8, 10, 3)]
    samples = [fortran(scale * values, 8, 10, 3) for scale in (1.0, 0.1, 0.01)]
    parts = [part for line, rows in zip(lines, samples, strict=False) for part in (line, rows)]
    return text(
        "CORRECTED ACCELEROGRAM DATA OF VOLUME II",
        "SOME EARTHQUAKE  JAN 17, 1994 -1230 GMT                                 21",
        "STATION USC# 0057   34 25 09N, 118 25 34W                               39",
        "COMP N00W                                                               9",
        "UNITS ARE SEC AND G/10                                                  22",
        f"PEAK ACCELERATION = {150.5 if peak is None else peak:.4f} CMS/SEC/SEC AT 1.0 SEC",
        "PEAK VELOCITY = -15.0500 CMS/SEC AT 1.0 SEC",
        *([lines[0], *header, *parts[1:]] if line_first else [*header, *parts]),
        "VLEE $",
    )


def sac_text(values=None, npts=None, depmax=None, dt=0.01):
    values = motion() if values is None else values
    reals, integers = [-12345.0] * 70, [-12345] * 40
    reals[0], reals[1] = dt, min(values)
    reals[2] = max(values) if depmax is None else depmax
    reals[5], reals[6], reals[56] = 0.0, dt * (len(values) - 1), float(np.mean(values))
    integers[:7] = [1999, 12, 3, 4, 5, 600, 6]
    integers[9], integers[15], integers[35] = len(values) if npts is None else npts, 1, 1
    texts = ["TAP006".ljust(8) + "Somewhere".ljust(16), *["-12345".ljust(8) * 3] * 5]
    texts += ["-12345".ljust(8) * 2 + "HNE".ljust(8), "TW".ljust(8) + "-12345".ljust(8) * 2]
    return text(
        columns(reals, 5, "#14.7g"),
        ["".join(f"{value:10d}" for value in integers[i : i + 5]) for i in range(0, 40, 5)],
        texts,
        columns(values, 5, "#14.7g"),
    )


def smc(
    values=None, title="2 CORRECTED ACCELEROGRAM", rate=200.0, npts=None, comments=2, **changed
):
    values = motion() if values is None else values
    count = changed.pop("count", len(values))
    integers, reals = [-32768] * 48, [1.7e38] * 50
    integers[1:7] = [1989, 291, 0, 4, 7, 250]
    integers[12], integers[13] = 90, 360
    integers[15], integers[16] = comments, count if npts is None else npts
    reals[1], reals[29], reals[31] = rate, float(np.max(values)), float(np.min(values))
    for numbers, name in ((integers, "integers"), (reals, "reals")):
        for index, number in changed.get(name, {}).items():
            numbers[index] = number

    def value_field(value):
        mantissa, exponent = f"{value:.4E}".split("E")
        return f"{mantissa:>7}E{int(exponent):+d}"

    fields = [value_field(value) for value in values]
    return text(
        title,
        "*",
        "SAF0A",
        "     1989  10  18    0004 Somewhere",
        "*",
        "station = somewhere",
        ["*"] * 5,
        ["".join(f"{value:10d}" for value in integers[i : i + 8]) for i in range(0, 48, 8)],
        ["".join(f"{value:15.7E}" for value in reals[i : i + 5]) for i in range(0, 50, 5)],
        ["|", "| ref - none"],
        ["".join(fields[i : i + 8]) for i in range(0, len(fields), 8)],
    )


def esm(values=None, ndata=None, units="cm/s^2", data_type="ACCELERATION"):
    values = motion() if values is None else values
    return text(
        "EVENT_NAME: SOMEWHERE",
        "EVENT_ID: none",
        "MAGNITUDE_W: ",
        "NETWORK: XX",
        "STATION_CODE: FAR1",
        "STATION_NAME: Town Hall, Far: North",
        "LOCATION: ",
        "DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS: 20190728_160919.870",
        "SAMPLING_INTERVAL_S: 0.005000",
        f"NDATA: {len(values) if ndata is None else ndata}",
        "DURATION_S: 0.595",
        "STREAM: HNE",
        f"UNITS: {units}",
        f"PGA_CM/S^2: {np.max(np.abs(values)):.6f}",
        "TIME_PGA_S: 0.1",
        f"DATA_TYPE: {data_type}",
        "USER1: a b c",
        "USER2: ",
        [f"{value:.6f}" for value in values],
    )


def geonet(volume=2, components=("S16W", "S74E", "Up"), readings="1.00"):
    body = []
    for name, peak in zip(components, (41.6, -194.0, 27.3), strict=False):
        values = motion(peak=peak, decimals=1)
        n = len(values)
        integers = [0] * 40
        integers[8:10], integers[18:20] = [2018, 2], [12, 21]
        integers[38], integers[39], integers[33] = 15, 17000, n
        integers[34:36] = [n, n] if volume == 2 else [0, 0]
        reals = [0.0] * 60
        reals[24], reals[25] = 0.005, 0.02
        raw = f"Raw readings in units of {readings} mm/s/s  at intervals of 0.02 s"
        body += [
            f"{'C' if volume == 2 else 'Unc'}orrected accelerogram 20180212_211554_FARS_20 GNS "
            "Science",
            "Site FARS      39 56 38S  176 35 04E     file: none",
            *["none"] * 8,
            "Instrument corrected data at 0.020 sec intervals" if volume == 2 else raw,
            "none",
            f"Component {name}  Longitudinal Accelerometer Axis",
            f"Acceleration:  peak  {peak * float(readings):.1f} mm/s/s at  43.68 sec     rms      "
            "2.2 mm/s/s",
            *["none"] * 2,
            *["".join(f"{value:8d}" for value in integers[i : i + 10]) for i in range(0, 40, 10)],
            *fortran(reals, 10, 8, 4),
            *fortran(values, 10, 8, 1),
        ]
        if volume == 2:
            body += fortran(values / 10, 10, 8, 3) + fortran(values / 100, 10, 8, 5)
    return text(body)


def one_column(values=None, header="# dt = 0.01 s, units = g"):
    values = motion() if values is None else values
    return text([header] if header else [], [f"{value:.3f}" for value in values])


def two_columns(values=None, header="time_s,acceleration_m_s2", separator=",", dt=0.01, decimals=3):
    values = motion() if values is None else values
    rows = [f"{i * dt:.{decimals}f}{separator}{value:.3f}" for i, value in enumerate(values)]
    return text([header] if header else [], rows)


def commented(text, rows=29):
    """Write # before each of the first lines, the header of an SMC file with two comments."""
    lines = text.splitlines()
    return "\n".join([*("#" + line for line in lines[:rows]), *lines[rows:], ""])
