"""Small records in the formats of single networks (`tdint.ground_motion.formats`)."""

import numpy as np

from ground_motion.format_files import columns, fortran, motion, text

PEAKS = (1.5, -2.25, 0.5)


def components(samples=120, decimals=3):
    return [motion(samples, peak, decimals) for peak in PEAKS]


def afad(values=None, count=None, peaks=PEAKS):
    values = components() if values is None else values
    stated = " ".join(
        f"({name}) {abs(peak):.6f}" for name, peak in zip(("N-S", "E-W", "U-D"), peaks, strict=True)
    )
    return text(
        "STRONG GROUND MOTION RECORDS OF TURKIYE",
        "PLACE                   : AYD\u0130N",
        "STATION ID              : 0921",
        "RECORD TIME             : 20/07/2017 22:30:58.500000 (GMT)",
        f"NUMBER OF DATA          : {len(values[0]) if count is None else count}",
        "SAMPLING INTERVAL (sec) : 0.01",
        f"RAW PGA VALUES (gal)    : {stated}",
        "       N-S          E-W          U-D",
        [" ".join(f"{value:12.6f}" for value in row) for row in zip(*values, strict=True)],
    )


def cwb(values=None, length=None, rate=50):
    values = components() if values is None else values
    n = len(values[0])
    extremes = [
        f"#AmplitudeMAX. {name}: {max(v):8.3f}~ {min(v):8.3f}"
        for name, v in zip("UNE", values, strict=True)
    ]
    return text(
        "#Earthquake Information",
        "#Origin Time(GMT+08): 2018/02/06-23:50:42",
        "#StationCode: ECU",
        "#StartTime(GMT+08): 2018/02/06-23:50:29.000",
        f"#RecordLength(sec): {n / 50 if length is None else length:g}",
        f"#SampleRate(Hz): {rate}",
        "#AmplitudeUnit:  gal. DCoffset(corr)",
        extremes,
        "#DataSequence: Time U(+); N(+); E(+)",
        "#Data: 4F10.3",
        fortran(np.column_stack([np.arange(n) * 0.02, *values]).ravel(), 4, 10, 3),
    )


def csmnc(values=None, count=None, peak=None, station="64ABC 40.000N 80.000E", component="NS"):
    """Eight samples in a row; the last row is short."""
    values = motion(120, 182.34) if values is None else values
    stated = values[np.argmax(np.abs(values))] if peak is None else peak
    return text(
        "064ABC220714091500",
        "0220714091512 2022-07-14 09:15:12 BTM",
        "SOMEWHERE,CHINA",
        "EPICENTER  40.100N 80.200E DEPTH 11 KM",
        "MAGNITUDE  5.1(Ms)",
        f"STATION: {station}",
        "SITE CONDITION: SOIL",
        "INSTRUMENT TYPE: X-1",
        "OBSERVING POINT: GROUND",
        f"COMP. {component}",
        "UNCORRECTED ACCELERATION          UNIT: CM/SEC/SEC",
        f"NO. OF POINTS:  {len(values) if count is None else count}  EQUALLY SPACED INTERVALS OF:  "
        "0.005  SEC",
        f"PEAK VALUE:    {stated:.3f}   AT    3.71 SEC    DURATION:  1 SEC",
        "PRE-EVENT TIME:  20  SEC",
        "",
        columns(values, 8, "13.6E"),
    )


def unam(values=None, count=None, repeated=0):
    values = components() if values is None else values
    n = len(values[0]) if count is None else count
    rows = ["".join(f"{value:10.3f}" for value in row) for row in zip(*values, strict=True)]
    ruler = "---------+" * 8
    return text(
        "*" * 60,
        "      INSTITUTO DE INGENIERIA, UNAM",
        "ARCHIVO ESTANDAR DE ACELERACION:",
        "CLAVE DE LA ESTACION                   : CUP5",
        "ORIENTACION C1-C6 (rumbo;orientacion)  : /V/N90E/N00E",
        "ORIENTACION C7-C12 (rumbo;orientacion) :",
        "INTERVALO DE MUESTREO, C1-C6 (s)       : /0.004/0.004/0.004",
        "INTERVALO DE MUESTREO, C7-C12 (s)      :",
        "FECHA DEL SISMO [GMT]                  : 2004/01/01",
        "HORA EPICENTRO (GMT)                   : 23:58:02.7",
        "HORA DE LA PRIMERA MUESTRA (GMT)       : 00:00:01    ",
        f"NUM. TOTAL DE MUESTRAS, C1-C6          : /{n}/{n}/{n}",
        f"ACEL. MAX.(Gal), C1-C6                 : /{'/'.join(f'{peak:.2f}' for peak in PEAKS)}",
        "UNIDADES DE LOS DATOS                  : Gal (cm/s/s)",
        "DATOS DE ACELERACION:",
        ruler,
        "   CANAL-1   CANAL-2   CANAL-3",
        "         V      N90E      N00E",
        ruler,
        rows,
        [rows[-1]] * repeated,
    )


def bhrc(values=None, count=None, rate=200.0):
    values = components(decimals=6) if values is None else values
    body = []
    for name, samples in zip(("L1", "V2", "T3"), values, strict=True):
        n = len(samples)
        integers = [
            f"{value:5d}" for value in [0] * 27 + [n if count is None else count] + [0] * 72
        ]
        reals = [
            f"{value:13.6E}"
            for value in [0.02, 0.64, n / 200, 0.0, 0.1, 0.0, 0.0, 0.0, rate] + [0.0] * 41
        ]
        body += [
            "* VOL1DS FILE:  5526/01",
            "Inst Type = SSA-2",
            f"COMP {name}    ",
            "Avin                      Station   37.734 N 47.801 E   Altitude 2026m   Azimuth L 50 "
            "   T 140",
            f"NO. OF POINTS = {n:6d}      DURATION = {n / 200:8.3f}",
            "UNITS ARE SECONDS AND G/10",
            *["".join(integers[i : i + 16])[:70] for i in range(0, 100, 16)],
            *["".join(reals[i : i + 8])[:70] for i in range(0, 50, 8)],
            *columns(samples, 10, "13.6E"),
            "/&",
        ]
    return text(body)
