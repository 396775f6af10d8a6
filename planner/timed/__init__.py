"""Timed plans: the necessary order of a plan's steps, schedules of the steps, and a checker (docs/levels.md, "In time").

The modules build on one another. A reader can follow them in this order:

1. `plan`: timed plans; `pieces`: the begin, middle and end of a behaviour; `activities`: what each step reads and changes.
2. `order` (with `pools`): the order that every schedule keeps; `network`: the earliest begins.
3. `schedules` (with `listing`, `exchange` and `cpsat`): the order of turns, and their actors.
4. `call.in_time`: the schedule of a plan's steps; `validation`: the checker.
5. `spreading`, `sharing` (with `takeovers`) and `bounds`: other steps, and bounds for any steps; `call.best_in_time` uses them.
6. `concurrent` (with `envelopes`): plans whose steps have to overlap.
7. `dispatch`: execution; `measuring`: measured durations.
"""
