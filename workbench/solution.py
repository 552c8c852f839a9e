"""Answer a Program by a method, or compute a Study, and certify the answer."""

from __future__ import annotations

import importlib
import math
import time
import traceback
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

from workbench._core.arrays import content_hash
from workbench._core.heavy_types import Figure
from workbench.answer import Answer
from workbench.certificate import Certificate
from workbench.errors import InputError, TimeLimitError, UnknownNameError, words_of
from workbench.executor import Context
from workbench.executor.clock import clocked_by
from workbench.executor.live import shown_live
from workbench.program import Task
from workbench.solvers import Options, Outcome

LONGEST = 1000
"""Most characters of a text that a printed solution shows."""


def _cut(text: str, most: int = 200) -> str:
    """A text, shortened to at most this many characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


@dataclass(frozen=True)
class Solution:
    """An answer, its method's claim, and its certificate."""

    answer: Any
    claim: Outcome
    message: str
    certificate: Certificate | None
    _: KW_ONLY
    seconds: Mapping[str, float] = field(default_factory=dict)
    trace: str = ""
    note: str = ""
    """A further remark, for instance that the tolerance asked for makes no difference."""
    proof: Task | None = None
    """The task that answer and certificate belong to, if they prove that there is no answer."""
    task: Task | None = field(default=None, repr=False)
    """The task that was asked."""

    def __repr__(self) -> str:
        lines = [f"Solution: {self.outcome}"]
        if self.message:
            lines[0] += f" ({_cut(self.message)})"
        evidence = self.proof is not None and not isinstance(self.answer, Answer)
        # Raw evidence is for the certificate, not for readers.
        if self.answer is not None and not evidence:
            said = self.answer.summary() if isinstance(self.answer, Answer) else repr(self.answer)
            lines += [f"  {line}" for line in _cut(said, LONGEST).splitlines()]
        if self.certificate is not None:
            failed = self.certificate.failures
            said = (
                "; ".join(failed) if failed else f"all {len(self.certificate.checks)} checks hold"
            )
            lines.append(f"  certificate: {_cut(said)}{self._headline}")
            over = self._answered.quantifier if self._answered is not None else ""
            lines += [f"  {_cut(over)}"] if over else []
        return "\n".join(lines)

    @property
    def _headline(self) -> str:
        """The main number, if there is one and the answer is valid."""
        task, certificate = self._answered, self.certificate
        if task is None or not task.headline or certificate is None or not certificate.valid:
            return ""
        number = task.metrics(self.answer).get(task.headline)
        return "" if number is None else f"; {task.headline.replace('_', ' ')} {number:.6g}"

    @property
    def _answered(self) -> Task | None:
        """The task that the answer belongs to."""
        return self.proof or self.task

    @property
    def holds(self) -> bool:
        """Whether there is a certificate and it holds."""
        return self.certificate is not None and self.certificate.holds

    @property
    def value(self) -> float:
        """The main metric of the task; NaN if it has none, or if nothing was checked."""
        task = self._answered
        if task is None or self.certificate is None:
            return math.nan
        return task.headline_value(self.answer)

    @property
    def metrics(self) -> dict[str, float]:
        """The numbers people quote; empty unless an answer could be checked."""
        task = self._answered
        return {} if task is None or self.certificate is None else task.metrics(self.answer)

    @property
    def figures(self) -> dict[str, Figure]:
        """Figures by name; the first is the main one."""
        task = self._answered
        return {} if task is None or self.certificate is None else task.figures(self.answer)

    def plot(self, name: str | None = None) -> Figure:
        """A figure of the answer, by name; None: the main one. A notebook shows it.

        Raises
        ------
        InputError, UnknownNameError
            The answer has no figure, or none of this name.
        """
        drawn = self.figures
        if not drawn:
            reason = _cut(self.message) or "it has none"
            raise InputError(f"there is no figure of this answer: {reason}")
        name = name or next(iter(drawn))
        if name not in drawn:
            raise UnknownNameError("figure", name, drawn)
        return drawn[name]

    @property
    def lti(self) -> Any:
        """The answer as a linear system.

        Raises InputError unless a certificate says that the answer is valid, and for a proof that
        there is none.
        """
        answer = None if self.proof is not None else self.answer
        return certified_answer(answer, self.certificate, self.message)

    @property
    def outcome(self) -> Outcome:
        """The outcome by the certificate, whatever the method claimed.

        After a time limit a valid answer counts as the best so far, unless the gap proves that it
        is optimal. The claim that there is no answer counts for nothing without a proof.
        """
        if self.proof is not None and self.certificate is not None:
            if self.certificate.holds:
                return self.claim
            return Outcome.NONE_UP_TO_R if self.certificate.valid else Outcome.NO_CLAIM
        if self.certificate is None:
            claims_an_answer = self.claim in (Outcome.SOLVED, Outcome.INACCURATE)
            if self.claim.without_answer:
                return Outcome.NO_CLAIM
            return Outcome.FAILED if claims_an_answer else self.claim
        gap = self.certificate.gap
        best = gap is not None and gap.closed
        if self.claim is Outcome.TIME_LIMIT and self.certificate.valid and not best:
            return Outcome.TIME_LIMIT
        return self.certificate.outcome


def certified_answer(answer: Any, certificate: Certificate | None, message: str) -> Any:
    """An answer that later steps rely on; raises InputError unless it is certified to be valid."""
    if certificate is None or answer is None:
        raise InputError(
            f"there is no certified answer to go on with: {message or 'none was given'}"
        )
    if not certificate.valid:
        raise InputError(
            f"the answer's certificate does not hold ({'; '.join(certificate.failures)}); to "
            "use it nevertheless, take `.answer`"
        )
    return answer


STATED_ELSEWHERE = {"cvxpy.problems.problem.Problem": "workbench.conic.cvxpy_program"}
"""For a class of another library that states a problem: the module here whose `solve_problem`
solves it.

The module is imported when such a problem is given."""


def solve(
    task: Any,
    *,
    method: str | None = None,
    options: Options | None = None,
    context: Context | None = None,
) -> Solution:
    """Answer a Program by a method (or compute a Study) and certify the answer.

    Without a context, progress is shown at a terminal or in a notebook. An exception of a method
    does not leave this function: the method has failed, and the exception's text is its message.

    Parameters
    ----------
    task
        A Program, a Study, or a `cvxpy.Problem`, which becomes a `workbench.conic.CvxpyProgram`.
        Afterwards the problem has a value, a status and values of its variables and dual variables,
        as after CVXPY's own ``solve``, but only if they are certified.
    method
        A method of the Program, such as the name of a solver; None: the default one.
    options, context
        Accuracy, time limit and seed; or the context of an enclosing piece of work, which has these
        and more.

    Raises
    ------
    UnknownNameError, InputError
        As `find_method`; a method was named for a Study, which has none; or the problem cannot be
        certified.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import workbench as wb
    >>> x = cp.Variable(2, name="x")
    >>> problem = cp.Problem(cp.Maximize(cp.sum(x)), [cp.norm(x) <= 5, x[0] == 3])
    >>> solution = wb.solve(problem)
    >>> solution.holds, round(solution.value, 5), round(float(x.value[1]), 5), problem.status
    (True, 7.0, 4.0, 'optimal')
    """
    for kind in type(task).__mro__:
        elsewhere = STATED_ELSEWHERE.get(f"{kind.__module__}.{kind.__qualname__}")
        if elsewhere:
            answered: Solution = importlib.import_module(elsewhere).solve_problem(
                task, method, options, context
            )
            return answered
    if context is None:
        with shown_live(type(task).__name__) as (progress, watch):
            shown = Context(options=options or Options(), progress=progress, watch=watch)
            return solve(task, method=method, context=shown)
    return judge(task, method, ask(task, method, context), context)


def ask(task: Task, method: str | None, context: Context) -> Solution:
    """A method's answer and claim, without a certificate. Raises as `solve`.

    Time that the method does not book as statement counts as solving.
    """
    if not isinstance(task, Task):
        raise InputError(
            f"a Program, a Study or a cvxpy.Problem is needed, not {type(task).__name__}"
        )
    asked = context.options.accuracy
    note = task.unheeded(method, asked)
    need_unchanged(task)

    trace = ""
    start = time.perf_counter()
    try:
        with clocked_by(context), context.at(task.accuracy_range(method).served(asked)):
            answer, claim, message = task.respond(method, context)
    except TimeLimitError as error:
        answer, claim, message = None, Outcome.TIME_LIMIT, str(error)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # A Rust panic is not derived from Exception.
        answer, claim, message = None, Outcome.FAILED, words_of(error)
        trace = traceback.format_exc()
    total = time.perf_counter() - start
    try:
        need_unchanged(task, _subject(task, method))
    except InputError as error:
        answer, claim, message = None, Outcome.FAILED, str(error)
    if answer is not None and context.stopped:
        claim, message = Outcome.TIME_LIMIT, context.stopped
    stated = context.statement_seconds
    seconds = {"statement": stated, "solve": total - stated}
    return Solution(
        answer, claim, message, None, seconds=seconds, trace=trace, note=note, task=task
    )


def need_unchanged(task: Task, by: str = "somebody") -> None:
    """Raise InputError if the data of a task have changed since it was first solved.

    So the answers of all methods are certified against the same data.
    """
    now = content_hash(task)
    if vars(task).setdefault("_first_asked", now) != now:
        raise InputError(
            f"the data of this {type(task).__name__} were changed by {by} since it was first "
            "asked: make it anew; an answer to data that change cannot be certified"
        )


def _subject(task: Task, method: str | None) -> str:
    """The method that was asked, or the Study itself, as a subject of a sentence."""
    name = type(task).__name__
    return f"method {method!r} of {name}" if method else name


def judge(task: Task, method: str | None, said: Solution, context: Context) -> Solution:
    """A method's answer with its certificate, or with the proof that there is no answer."""
    if said.answer is None:
        return _with_proof(task, said, context) if said.claim.without_answer else said
    start = time.perf_counter()
    optimal = task.claims_optimum(method) and said.claim is not Outcome.TIME_LIMIT
    tolerance = task.judging_tolerance(method, context.options.accuracy)
    try:
        answer = task.witnessed(said.answer)
        certificate = task.certify(answer, tolerance, optimal=optimal)
    except Exception as error:
        came = f"{_subject(task, method)} returned a {type(said.answer).__name__}"
        reason = (
            f"the answer cannot be checked ({words_of(error)}): {came}, and "
            f"{task.answer_type()} is needed"
        )
        message = f"{reason}; the method said: {said.message}" if said.message else reason
        return replace(said, answer=None, message=message, trace=traceback.format_exc())
    seconds = {**said.seconds, "check": time.perf_counter() - start}
    if isinstance(answer, Answer):
        answer.with_checker(task, gap_tolerance=tolerance, optimal=optimal, certificate=certificate)
    return replace(said, answer=answer, certificate=certificate, seconds=seconds)


def proof_task(task: Task, claim: Outcome, outcome: Outcome) -> Task | None:
    """The task of a stored answer that proves a claim of no answer; otherwise None."""
    proofs = (claim, Outcome.NONE_UP_TO_R, Outcome.NO_CLAIM)
    stored_proof = claim.without_answer and outcome in proofs
    return task.claim_task(claim) if stored_proof else None


def _with_proof(task: Task, found: Solution, context: Context) -> Solution:
    """A claim that there is no answer, together with its proof, whoever finds that."""
    start = time.perf_counter()
    try:
        proof = task.claim_task(found.claim)
        if proof is None:
            return found
        evidence, _, said = proof.respond(None, context)
        message = f"{found.message}; {said}" if found.message else said
        if evidence is None:
            return replace(found, message=message)
        certificate = proof.certify(evidence, context.options.accuracy)
    except Exception as error:
        message = f"{found.message}; not proven: {words_of(error)}"
        return replace(found, message=message, trace=traceback.format_exc())
    seconds = {**found.seconds, "check": time.perf_counter() - start}
    return replace(
        found,
        answer=evidence,
        message=message,
        certificate=certificate,
        seconds=seconds,
        proof=proof,
    )
