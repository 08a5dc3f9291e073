"""Public names of `tdint` and `tdint.plugin`, and the modules that define them.

Both import a name at its first use. `python tests/stubs.py` writes the names for type checkers.
"""

from collections.abc import Mapping, Sequence


def by_name(names_by_module: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return the module of each name."""
    return {name: module for module, names in names_by_module.items() for name in names}


PUBLIC = by_name(
    {
        "tdint.assessment.chart.performance_profiles": ["FieldChart", "performance_profiles"],
        "tdint.assessment.chart.work_precision": ["Chart", "chart"],
        "tdint.assessment.examples.paper_examples": ["ExampleRun", "paper_examples"],
        "tdint.assessment.failures.failures": ["failures", "Trial"],
        "tdint.assessment.order.order": ["ObservedOrder", "order"],
        "tdint.assessment.stability.stability": [
            "Overshoot",
            "overshoot",
            "stability",
            "StabilityCurve",
        ],
        "tdint.assessment.validation.validation": ["validate", "ValidationResult"],
        "tdint.errors": ["TdintError"],
        "tdint.ground_motion.choice": ["TextLayout"],
        "tdint.ground_motion.horizontals": ["Horizontals"],
        "tdint.ground_motion.processing_steps": ["process"],
        "tdint.ground_motion.reading.read": ["make_record", "read_horizontals", "read_record"],
        "tdint.ground_motion.record": ["Record"],
        "tdint.methods.catalogue": ["load_plugin", "methods"],
        "tdint.methods.method": ["Integrator"],
        "tdint.model.config.model_file": ["load_model"],
        "tdint.model.definition": ["Model"],
        "tdint.model.first_model": ["model_template"],
        "tdint.model.modes": ["Modes"],
        "tdint.output.plotting": ["plot"],
        "tdint.output.tables.spectra": ["record_info", "RecordInfo"],
        "tdint.output.to_dict": ["to_dict"],
        "tdint.response.matrices": ["matrices", "StateSpace", "SystemMatrices"],
        "tdint.response.overview": ["check", "modes", "Overview"],
        "tdint.response.runs.analysis_kernels": ["compile_model"],
        "tdint.response.runs.case": ["Case"],
        "tdint.response.runs.energy": ["Energy"],
        "tdint.response.runs.history": ["History"],
        "tdint.response.runs.many_results": ["Runs"],
        "tdint.response.runs.outcome": [
            "Collapse",
            "ErrorEstimate",
            "EventResponse",
            "FailedRun",
            "Gradient",
            "Response",
            "StoryErrors",
            "StoryPeaks",
        ],
        "tdint.response.runs.run": ["prepare", "run", "run_case"],
        "tdint.response.runs.run_many": ["run_many"],
        "tdint.response.runs.sequence": ["run_sequence"],
        "tdint.response.spectra.drift": ["drift_spectrum", "DriftSpectrum", "HeightPeriod"],
        "tdint.response.spectra.elastic": ["Spectrum", "spectrum"],
        "tdint.response.spectra.floor_motions": ["floor_spectra", "FloorSpectrum"],
        "tdint.response.spectra.fourier": ["fourier_spectrum", "FourierSpectrum"],
        "tdint.response.spectra.inelastic": [
            "constant_ductility",
            "constant_strength",
            "InelasticSpectrum",
        ],
        "tdint.response.spectra.modal": ["ModalResponse", "response_spectrum_analysis"],
        "tdint.response.spectra.rotated": ["rotated_spectrum", "RotatedSpectrum"],
        "tdint.response.spectra.target": ["TargetSpectrum"],
        "tdint.response.spectra.transfer": ["transfer_function", "TransferFunction"],
        "tdint.response.static.cyclic": ["cyclic_test", "CyclicTest"],
        "tdint.response.static.pushover": ["Pushover", "pushover"],
        "tdint.response.static.target_displacement": [
            "target_displacements",
            "TargetDisplacements",
        ],
        "tdint.studies.campaign.execute": ["campaign", "CampaignRuns"],
        "tdint.studies.fragility.fit_table": ["fragility", "FragilityResult"],
        "tdint.studies.fragility.fits": ["fit_capacities", "fit_cloud", "fit_stripes"],
        "tdint.studies.fragility.fragility_function": ["Fragility"],
        "tdint.studies.ida.ida": ["ida", "IdaSettings", "IdaStudy"],
        "tdint.studies.ida.ida_curve": ["Mainshock"],
        "tdint.studies.motions.matching": ["Match", "match", "match_suite"],
        "tdint.studies.motions.scaling": ["scale", "Scaling"],
        "tdint.studies.motions.selection": ["select"],
        "tdint.studies.recordings.compare": ["compare", "Comparison"],
        "tdint.studies.regions.inventory": ["inventory", "InventoryBuilding"],
        "tdint.studies.sensitivity.sensitivity": ["ParameterEffect", "sensitivity"],
        "tdint.tabular": ["ResultList"],
    }
)
"""Module that defines each public name of `tdint`."""

PLUGIN = by_name(
    {
        "tdint.assessment.chart.problem": ["Problem"],
        "tdint.errors": ["AnalysisError", "RecordError", "UsageError"],
        "tdint.ground_motion.formats.lines": ["Lines", "NUMBER", "recognizes"],
        "tdint.ground_motion.formats.series": [
            "motion_units",
            "reader",
            "required_units",
            "Series",
        ],
        "tdint.ground_motion.measures": ["Measure"],
        "tdint.ground_motion.record": ["Record"],
        "tdint.kernels.compiling": [
            "F8",
            "I8",
            "inline",
            "kernel",
            "local",
            "local_table",
            "outlined",
            "TABLE",
            "VECTOR",
        ],
        "tdint.kernels.equations.newton": [
            "EQUILIBRIUM_ROWS",
            "factor_rows",
            "invalidate",
            "ROW",
            "solve_equilibrium",
        ],
        "tdint.kernels.equations.tridiagonal": [
            "assemble_blocks",
            "assemble_combination",
            "Combination",
            "COUPLING_ROWS",
            "factor",
            "factor_blocks",
            "factor_combination",
            "factor_damped",
            "link_blocks",
            "ModalBlocks",
            "solve",
            "solve_blocks",
            "solve_blocks_damped",
            "solve_damped",
        ],
        "tdint.kernels.laws.branch_following": [
            "add_work",
            "branch_first",
            "branch_follower",
            "copy_extra_rows",
            "extra_rows",
            "fail",
            "follow_branches",
            "no_operation",
            "set_branch",
        ],
        "tdint.kernels.laws.law": [
            "DriftLaw",
            "LawFunctions",
            "LawParameter",
            "yields_at_its_strength",
        ],
        "tdint.kernels.layout": ["chained", "rows"],
        "tdint.kernels.linear_terms": [
            "add_modal_force",
            "finite",
            "floor_impulse",
            "floor_load",
            "force_impulse",
            "force_moment",
            "force_rate",
            "force_value",
            "internal_forces",
            "power_damper",
        ],
        "tdint.kernels.stepping": ["EffectiveCoefficients", "Factors", "Memory", "Scene", "STEP"],
        "tdint.kernels.stories.law_state": [
            "accumulate_dissipation",
            "commit",
            "commit_without_dissipation",
            "hysteretic_energy",
            "restoring_force",
            "restoring_force_outlined",
            "resume",
            "strain_energy",
        ],
        "tdint.methods.bathe": ["composite_method", "ImplicitTableau"],
        "tdint.methods.method": ["Family", "Method", "Parameter"],
        "tdint.units": ["Quantity"],
    }
)
"""Module that defines each name of `tdint.plugin`; `rows` is the name of a module."""

DEFINED_AS = {"check": "overview", "methods": "list_methods"}
"""Public names of `tdint` that differ from the names in the modules that define them, with these
names."""
