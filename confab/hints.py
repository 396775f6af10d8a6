"""What a wrong name meant: names that other libraries use, and the ones that do the same here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

from confab.reasoner.names import nearest

MODULE = {
    "confab.load(SCENE)": "open read read_scene load_scene load_file load_ontology from_file parse World Ontology",
    "confab.scenes()": "list_scenes list_examples available_scenes datasets samples",
    "confab.load(SCENE).plan()": "plan solve search find_plan Planner OneshotPlanner get_plan make_plan run_planner",
    "confab.load(SCENE).query(TEXT)": "query ask sparql select",
    "confab.load(SCENE).verify()": "verify simulate simulation Simulator connect",
    "confab.load(SCENE).execute()": "execute run act step",
    "confab.validate(FILE)": "check lint verify_file validate_scene shacl",
    "confab.generate(FAMILY, …)": "create new make make_scene random_scene new_scene",
    "confab.new_domain(NAME)": "new_ontology create_domain init",
    "confab.Memory.load(FILE)": "load_memory read_memory learn",
}
SCENE = {
    "query": "ask sparql select sparql_query execute_query run_query",
    "with_fact": "add_fact set_fact set add assert_fact update change tell put set_value set_initial_value",
    "with_goal": "set_goal add_goal goal with_goals set_goals",
    "plan": "solve find_plan search make_plan planner plan_to run_planner get_plan",
    "verify": "simulate simulation check check_plan validate_plan physics rollout",
    "execute": "run act apply step dispatch perform",
    "objects": "individuals all_objects instances things entities get_objects",
    "facts": "state initial initial_state init current_state get_state observe values",
    "goals": "goal_state get_goals task tasks",
    "picture": "draw show plot render image visualise visualize to_png",
    "problem.domain.behaviors": "behaviors behaviours actions operators skills get_actions",
    "problem.domain.situations": "situations situation_types predicates fluents",
    "problem.classes": "classes types sorts user_types",
    "problem.domain": "domain",
    "export": "to_pddl pddl write_pddl as_pddl",
    "affordances": "afforded afford possible_actions applicable applicable_actions",
    "graph()": "triples rdf to_rdf to_graph rdflib as_graph serialize serialise",
    "owl()": "owlready ontology onto world get_ontology to_owl owlready2",
    "embodiment": "robot robots arms body",
    "iri": "name uri base_iri namespace",
    "serve": "endpoint server start_server",
    "board": "widget edit editor",
    "construct": "constructs describe",
}
RESULT = {
    "plan.steps": "steps actions action_list sequence get_steps",
    "plan.primitives": "primitives leaves low_level",
    "plan.length": "length levels",
    "solved": "success succeeded is_solved ok found is_solvable has_plan",
    "outcome.status": "status state result",
    "outcome.reason": "reason failure error message",
    "outcome.cost": "cost metric value price",
    "outcome.bound": "bound lower_bound",
    "seconds": "time duration runtime elapsed",
    "json": "to_json to_dict as_dict dict dumps serialize serialise",
    "save": "dump write to_file store export",
    "graph": "to_networkx networkx to_graph nx digraph tree",
    "why": "why_step reasons justify explain_step because",
    "why_not": "whynot contrast alternatives why_isnt",
    "verify": "simulate check validate physics rollout",
    "execute": "run act perform dispatch",
    "report": "html show page to_html render",
    "outcome.search": "statistics stats search expansions nodes metrics log_messages",
}


def wrong_name(kind: str, name: str, there: object, hints: Mapping[str, str]) -> NoReturn:
    """Raise the error for a name that `there` lacks: with the name that does what it means, or the most similar one.

    Parameters
    ----------
    kind : str
        What lacks it, e.g. ``a scene``.
    name : str
    there : object
        Its public names are those that `dir` lists.
    hints : mapping of str to str
        A right name to the words that mean it.
    """
    text = f"{kind} has no '{name}'"
    if not name.startswith("_"):
        meant = next((right for right, wrong in hints.items() if name in wrong.split()), "")
        similar = nearest(name, [each for each in dir(there) if not each.startswith("_")])
        text += f"; use {meant}" if meant else similar
    raise AttributeError(text)
