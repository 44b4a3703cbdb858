"""What the book measures: trials of many methods, their statistics and figures.

`companion.Results(folder).frame()` is a table with one row per trial. Importing
`companion` itself imports none of its subpackages, so it is quick.
"""

from sidm.lazy import public

#: Module -> its public names.
_MODULES = {
    "companion.registry": "FIGURES grid",
    "companion.methods": "METHODS",
    "companion.presets": "PRESETS Preset load_preset",
    "companion.trials": "Dataset Trial",
    "companion.engine.rows": "Failure Outcome Row",
    "companion.engine.store": "Results",
    "companion.engine.records": "StoreError",
    "companion.study": "Study",
    "companion.engine.run": "collect_and_run run",
    "companion.engine.datasets": "all_datasets collect_motion",
    "companion.engine.execute": "perform run_trial",
}
__all__, __getattr__, __dir__ = public(__name__, _MODULES)
