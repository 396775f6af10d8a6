"""Names that users of other libraries may try, and the corresponding names in Confab."""

from __future__ import annotations

from collections.abc import Mapping

MODULE = {
    "confab.load(SCENE)": "open read read_scene load_scene load_file load_ontology from_file parse World Ontology",
    "confab.scenes()": "list list_scenes list_examples available_scenes datasets samples",
    "confab.load(SCENE).plan()": "plan solve search find_plan Planner OneshotPlanner get_plan make_plan run_planner",
    "confab.load(SCENE).query(TEXT)": "query ask sparql select",
    "confab.load(SCENE).verify()": "verify simulate simulation Simulator connect",
    "confab.load(SCENE).execute()": "execute run act step",
    "confab.load(SCENE).behaviors": "Action Behavior Operator Skill actions",
    "confab.load(SCENE).facts": "Fact Literal Predicate State Atom facts",
    "confab.load(SCENE).goals": "Goal Task goals",
    "confab.history.compared(RUNS, ONE, OTHER)": "diff compare compare_plans compare_runs",
    "confab.validate(FILE)": "check lint verify_file validate_scene shacl",
    "confab.generate(FAMILY, …)": "create new make make_scene random_scene new_scene",
    "confab.new_domain(NAME)": "new_ontology create_domain init",
    "confab.Memory.load(FILE)": "load_memory read_memory learn",
}
SCENE = {
    "query": "ask sparql select sparql_query execute_query run_query subjects predicates_objects triples_matching value",
    "with_fact": (
        "add_fact set_fact set add assert_fact insert delete remove retract remove_fact delete_fact clone reset update change tell "
        "put set_value set_initial_value"
    ),
    "with_goal": "set_goal add_goal with_goals set_goals change_goal",
    "plan": "solve find_plan search make_plan planner plan_to run_planner get_plan",
    "verify": "simulate simulation check check_plan validate_plan physics rollout",
    "execute": "run act apply step dispatch perform",
    "objects": "individuals all_objects instances things entities get_objects",
    "facts": "state initial initial_state init current_state get_state observe values",
    "goals": "goal goal_state get_goals task tasks",
    "picture": "draw show plot render image visualise visualize to_png",
    "behaviors": "behaviours actions operators skills get_actions",
    "problem.domain.situations": "situations situation_types predicates fluents",
    "problem.classes": "classes types sorts user_types",
    "problem.domain": "domain",
    "to_pddl()": "pddl as_pddl get_pddl",
    "export": "write_pddl save_pddl",
    "to_unified_planning()": "unified_planning to_up",
    "read_episode(FILE)": "load_episode open_episode parse_episode load_execution read_execution",
    "read_report(FILE, PLAN)": "load_report load_verdicts read_verdicts load_verification",
    "read_plan(FILE)": "load_plan open_plan parse_plan",
    "affordances": "afforded afford possible_actions applicable applicable_actions successors legal_actions action_space",
    "graph": "triples rdf to_rdf to_graph rdflib as_graph serialize serialise",
    "owl": "owlready ontology onto world get_ontology to_owl owlready2",
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
    "cost": "metric value price total_cost",
    "outcome.bound": "bound lower_bound",
    "seconds": "time duration runtime elapsed",
    "json": "to_json to_dict as_dict dict dumps serialize serialise",
    "save": "dump write to_file store export",
    "plan.to_networkx()": "to_networkx networkx to_graph nx digraph tree graph",
    "plan.to_dot()": "to_dot dot graphviz",
    "plan.to_dataframe()": "to_dataframe dataframe to_pandas df to_csv",
    "why": "why_step reasons justify explain_step because",
    "why_not": "whynot contrast alternatives why_isnt",
    "verify": "simulate check validate physics rollout replay",
    "execute": "run act perform dispatch",
    "report": "html show page to_html render",
    "confab.history.compared(RUNS, ONE, OTHER)": "diff compare compare_to difference",
    "outcome.search": "log statistics stats search expansions nodes metrics log_messages",
}
EXECUTION = {
    "reached": "success succeeded ok solved done is_done finished goal_reached",
    "plan": "steps actions executed done_plan trace",
    "episode": "history log result trajectory record",
    "episode.events": "events observations",
    "episode.replans": "replans repairs changes",
    "episode.failures": "failures errors faults",
    "episode.status": "status state outcome",
    "json": "to_json to_dict as_dict dict dumps serialize serialise",
    "report": "html show page to_html render plot",
    "save": "dump write to_file store export",
    "summary()": "describe explain message text",
}
REPORT = {
    "verified": "success succeeded ok passed valid is_valid result",
    "rollouts": "runs trials simulations episodes",
    "shown.failure": "failure error first_failure failed why reason",
    "rate()": "success_rate accuracy score probability",
    "good": "successes n_success count",
    "trusted": "assumed unverified unchecked",
    "json": "to_json to_dict as_dict dict dumps serialize serialise",
    "table()": "to_dataframe dataframe steps details",
    "video": "film movie mp4 save_video animation",
    "summary()": "describe message text",
}
MEMORY = {
    "Memory.load(FILE)": "open read from_file",
    "save(FILE)": "write dump store to_file export persist",
    "learn(SCENE, PLAN)": "add train update fit record remember append observe",
    "teach(SCENE, PLAN)": "demonstrate show_plan imitate demonstration",
}
COMMANDS = {
    "plan": "solve search find optimise optimize planner schedule",
    "run": "demo all pipeline go start main run-plan",
    "scenes": "ls list examples samples datasets list-scenes",
    "execute": "act step robot perform dispatch drive",
    "verify": "simulate simulation sim test physics rollout rollouts replay check-plan",
    "explain": "why why-not whynot reason reasons describe justify",
    "report": "show view html page visualise visualize gantt dashboard",
    "picture": "draw plot render image png svg map diagram",
    "runs": "history log diff compare",
    "query": "ask sparql select graph facts info inspect dump affordances",
    "serve": "server open gui web ui browser endpoint",
    "validate": "check lint doctor shacl",
    "new": "init create skeleton template scaffold",
    "generate": "random make gen",
    "convert": "format translate rewrite",
    "import": "load read parse from-pddl import-pddl",
    "export": "save pddl to-pddl write export-pddl",
    "learn": "train fit practise practice teach bench",
    "memory": "experience",
    "mcp": "agent agents tools",
    "fetch": "download",
}
OPTIONS = {
    "--json": "format output-format as-json",
    "--output": "out file save dest destination html",
    "--time-limit": "timeout max-time limit deadline seconds budget",
    "--mode": "heuristic algorithm strategy search alg",
    "--engine": "planner solver backend",
    "--world": "sim simulator backend physics env environment gui",
    "--intervene": "disturb interrupt event disturbance",
    "--serve": "gui web browser live watch port",
    "--rollouts": "n runs trials repeats repetitions count episodes num",
    "--optimal": "best shortest optimize optimise",
    "--minimise": "minimize objective metric",
    "--goal": "goals target",
    "--report": "page html visualize visualise",
    "--memory": "experience learned",
    "--verbose": "debug log",
    "--quiet": "silent",
    "--observed": "state initial facts",
    "--video": "film movie mp4 record gif",
    "--seed": "random-seed rng random",
    "--noise": "sigma std",
    "--both-hands": "parallel bimanual both",
}


def meant(name: str, known: Mapping[str, str], table: Mapping[str, str]) -> str:
    """Return the known name that a wrong name means according to a table or its words; an empty text if there is none.

    Parameters
    ----------
    name : str
        A command, or an option with or without its hyphens.
    known : mapping
        The names to choose from, with their descriptions.
    table : mapping
        Right names with other names for the same thing: `COMMANDS` or `OPTIONS`.
    """
    from confab.guessing import chosen

    word = name.lstrip("-").replace("_", "-").lower()
    listed = (right for right, others in table.items() if right in known and word in others.split())
    return next(listed, "") or chosen(name, known)
