"""`tdint validate`: check an installation against published and exact results."""

from __future__ import annotations

from tdint.errors import AnalysisError
from tdint.number_parsing import pluralize
from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import progress_bar, say


@options.command
@options.output.to_files(in_units=False)
def command(outputs: Outputs) -> None:
    """Compare results of this installation with published and exact results.

    The references are closed-form solutions, textbook tables, printed results of other programs
    that need no input file, and results of a separate solver for each feature and each law. The
    cases are computed on this machine with its compiled time loops. CSV: maximum difference and
    tolerance of each case; the exit code is 5 if a difference exceeds its tolerance.
    tests/validation in the source tree has all cases with their values, including comparisons with
    other programs and with recordings.
    """
    from tdint.assessment.tables import VALIDATION
    from tdint.assessment.validation.validation import all_cases, compute_case
    from tdint.output.tables.table import Table

    cases = all_cases()
    results = []
    with progress_bar(to_terminal=outputs.table is None) as progress:
        for done, case in enumerate(cases):
            progress("validating", done / len(cases))
            results.append(compute_case(case))
    # Write the table before raising the error: it shows which cases fail and their differences.
    outputs.deliver(Table.of_results(VALIDATION, results))
    failed = [result for result in results if not result.within]
    say(f"{len(results) - len(failed)} of {len(results)} cases are within their tolerances.")
    if failed:
        first = failed[0]
        text = (
            f"{first.case.name}: the maximum difference, {first.largest:.3g}, exceeds the "
            f"tolerance {first.case.tolerance:.3g}"
        )
        if len(failed) > 1:
            text += f"; {pluralize(len(failed) - 1, 'more case')} also exceed their tolerances"
        raise AnalysisError(
            f"{text}; this installation does not reproduce the results of the released version"
        )
