"""What each kind of object has by purpose, and words of other libraries for the names of Confab.

Each index of `WORDS` and `HINTS` is a name or an expression of Confab; the value contains other names with the same meaning.
`confab.guessing` also compares the words of names: variants of a listed name with a filler, another ending or another order of the
words (``get_plan``, ``plans``) needn't be listed.
"""

from __future__ import annotations

from collections.abc import Mapping

OVERVIEW: Mapping[str, str] = {
    "confab": "to begin: confab.load(SCENE), confab.scenes(), confab.new_domain(NAME), confab.generate(FAMILY), "
    "confab.validate(FILE); with scene = confab.load(SCENE), to read: scene.facts, scene.objects, scene.goals, scene.behaviors, "
    "scene.query(TEXT); to change: scene.with_fact(FACT), scene.with_goal(FACT), scene.without_goal(GOAL); to plan: scene.plan(), "
    "scene.explain(); to try: scene.verify(), scene.execute(); to show: scene.picture(FILE), scene.plan().report(FILE), "
    "scene.serve(); to learn: confab.Memory.of(SCENE), confab.Memory.load(FILE), confab.practise(SCENES); to limit time: "
    "confab.within(SECONDS); also: Memory, Scene, Result, Report, Execution, Table, Curve, KnowledgeError, __version__",
    "scene": "to read: facts, derived_facts, objects, goals, behaviors, problem.classes, problem.domain.situations, embodiment, "
    "title; to ask: query(TEXT), affordances(OBJECT), explain(); to change (a copy): with_fact(FACT), with_goal(FACT), "
    "without_goal(GOAL); to plan: plan(); to try: verify(), execute(); to show: picture(FILE), board(), serve(), "
    "plan().report(FILE); to save: save(FILE), export(FOLDER), to_pddl(); to read files: read_plan(FILE), "
    "read_result(FILE), read_episode(FILE), read_report(FILE, PLAN); to use libraries: graph, owl, to_unified_planning(); "
    "also: iri, with_episodes(FILE), problem, knowledge, names, seconds, reading, read_whole, settle, construct, "
    "applicable_query, quantifying_query, update_of",
    "result": "to read: solved, cost, seconds, goals, outcome.status, outcome.reason, outcome.bound, outcome.search, timed, "
    "soft_goals; to walk: plan.steps, plan.primitives, plan.length, plan.at_level(LEVEL); to ask: why(STEP), why_not(WHAT), "
    "explain(), labels, purposes, dearer(), certificate; to try: verify(), execute(); to show: print(result), report(FILE), "
    "plan.to_dot(); to save: save(FILE), json(), plan.to_dataframe(), plan.to_networkx(); to plan again: scene.plan(GOALS), "
    "in_order(ID, …); also: plan, outcome, problem, scene, optimal, options, part, queries, faults, task, in_whole_scene",
    "plan": "to read: plan[NUMBER], steps, primitives, length, at_level(LEVEL), walk(), index(STEP); to ask: result.why(STEP), "
    "result.why_not(WHAT), result.cost, result.timed, result.labels; to try: scene.verify(plan), scene.execute(plan); to show: "
    "print(plan), to_dot(), result.report(FILE); to save: result.save(FILE), json(), to_records(), to_dataframe(), "
    "to_networkx(); to read files: scene.read_plan(FILE); to change: scene.plan(GOALS), result.in_order(ID, …); also: count",
    "step": "to read: behavior, arguments, bindings, level, id, path, rank, together, joined; to walk: steps, walk(); to ask: "
    "result.why(step), result.why_not(WHAT), scene.behaviors[step.behavior].preconditions, "
    "scene.behaviors[step.behavior].effects, result.timed; to show: print(step), result.labels.step(step); to try: "
    "scene.verify(plan), scene.execute(plan); to save: json()",
    "outcome": "to read: status, plan, reason, cost, penalty, total, bound, proved, forgone, unmet, saving, left; about the "
    "search: seconds, search, engine, given_up, fallbacks, hits, misses, effort, certificate",
    "reason": "to read: text, terms, states",
    "schedule": "to read: makespan, slots, intervals, lanes(), serial, work, plan; about optimality: bound, bounds, least, "
    "scheduler; also: arcs",
    "labels": "to read: name(NAME), fact(FACT), step(STEP), behavior(BEHAVIOR, TERMS), sentence(TEXT), about(SYMBOL), words, "
    "verbs; also: verb, condition, grounded, placed, domain",
    "explanation": "to read: what, step, number, id, path, gives, needs, reasons(), asked, answer, lacks, more, breaks, "
    "headline, steps, plan, proof; to save: json()",
    "execution": "to read: reached, plan, violations, soft_goals, episode.status, episode.reasons, episode.seconds; what "
    "happened: episode.events, episode.failures, episode.interventions, episode.replans, episode.observed, episode.course, "
    "notes(); to show: summary(), report(FILE), graph(); to save: save(FILE), json(); to go on: scene.execute(), "
    "memory.learn(scene, execution), scene.read_episode(FILE); also: episode, scene",
    "episode": "to read: status, reasons, done, planned, initial, observed, goal, soft_goals, course, seconds, scene; what "
    "happened: events, failures, interventions, replans, missed, discovered, refuted; to save: execution.save(FILE); also: "
    "measured",
    "report": "to read: verified, good, rate(), rollouts, shown.failure, trusted, poured, plan, goal, missed(ROLLOUT), noise, "
    "perturb; to show: summary(), table(), video, film_speed, notes(), result.report(FILE); to save: json(); to try again: "
    "scene.verify(plan); to read files: scene.read_report(FILE, PLAN); also: shown, scene",
    "rollout": "to read: ok, failure, steps, state, believed, seed, poured, cpu_seconds, simulated_seconds; to save: as_json(); "
    "also: clock",
    "entry": "to read: step, verdict, seconds; to save: as_json()",
    "verdict": "to read: ok, code, message, objects, measured, facts; to save: as_json(); also: swings, likewise",
    "memory": "to read: table(), advice(), durations(), also(), statistics, links, experience, trusted, scene; to learn: "
    "learn(RESULT), teach(RESULT), live(PROBLEM, EPISODE), measure(PROBLEM, REPORT), merge(OTHER), trust(REPLICAS); to use: "
    "scene.plan(memory=memory), scene.explain(memory=memory); to show: page(), said(); to save and load: save(FILE), "
    "confab.Memory.load(FILE), confab.Memory.of(SCENE); to measure: confab.practise(SCENES, memory); also: advisor, labels, "
    "linked, names, sayings, told",
    "table": "to read: [*table], len(table), table[ROW], columns, rows, values(), truth, count(ROW), index(ROW); to convert: "
    "records(), dataframe(), csv(), tsv(), turtle(), iris(), standard(FORMAT); to show: print(table); also: terms, empty",
    "problem": "to read: initial, goal, individuals, classes, relations, domain.behaviors, domain.situations, weights, times, "
    "scene; to ask: members(CLASS), values(SYMBOL, LEVEL), goal_on(LEVEL), at_rest(LEVEL), id_of(BEHAVIOR, ARGUMENTS); also: "
    "quantified, domain, first_level, only, without_goals, releases, read_by_goals, related, concerns, may_leave_rest, parents, "
    "sees, below, superclasses, value_levels",
    "domain": "to read: behaviors, situations, levels, at_level(LEVEL), rules, constraints, aggregates, authored; also: "
    "first_ids, remembers",
    "behaviour": "to read: name, level, parameters, preconditions, effects, cost, variables, timing, amounts; to ask: "
    "scene.affordances(OBJECT), scene.quantifying_query(NAME); also: asked, changes, conditions, every, every_effect, kinds, "
    "lasting, price, priced, spread",
    "situation": "to read: name, arguments, range, level, rest, default, boolean, quantity, perceived, properties; also: added",
    "symbol": "to read: situation, arguments; to ask: scene.facts",
    "fact": "to read: symbol.situation, symbol.arguments, value; also: symbol",
    "embodiment": "to read: robots, hand(NAME), fixtures, places, stands, bodies, mechanisms, fillings, cameras, skills, "
    "perceivers",
}
"""What each kind of object has, by purpose: its public names, and expressions for what users often want from it.

The names after ``also`` aren't shown in messages.
"""
WORDS: Mapping[str, str] = {
    "load": "open read parse World Ontology Problem Graph Environment Env connect Domain Task Loader make gym Kitchen reader "
    "OWLReader Model Dataset Store kb infer restore consult initialize initialise attach mount setup load_rdf from_file "
    "KnowledgeGraph from_string from_text get_scene import_scene knowledge_base PlanningProblem from_name SceneGraph "
    "import_ontology from_ttl from_path",
    "facts": "init pose position location head perceive sense state initial observe holds value belief atoms literals obs where "
    "current has o at know knows whereabouts status beliefs true initial_state planning_scene start_state "
    "explicit_initial_values initial_value initial_facts world_state check_fact fluent_values initial_defaults static_facts "
    "get_property predicate_values current_state is_holding pretty_facts state_dict",
    "objects": "individuals instances worldobjects things entities members items object constants bodies entity inventory stuff "
    "resources contents world_objects objects_of_type nodes_of_type subjects_of user_objects list_objects search_objects "
    "names_of instances_of_class",
    "goals": "goal objective desired wanted target tasks todo mission aim order request intention intent goal_test goal_state "
    "goal_facts goal_conditions goal_description current_goal goals_met",
    "behaviors": "skills action behaviour operator schema capabilities methods preconditions effects abilities primitives "
    "action_space action_names primitive_actions durative_actions",
    "query": "infer search ask sparql select question fetch inferred reason entailments entailed materialize materialise "
    "closure owlrl expand rows queries match cypher findall lookup retrieve datalog filter SparqlQuery execute_query "
    "run_reasoner search_one get_results",
    "with_fact": "add_fact set_fact remove_fact Fact add update set edit change tell put insert assume modify assign replace "
    "move without patch teleport retract believe suppose imagine pretend shift relocate displace swap transform assert_fact "
    "set_initial_value with_facts set_property observe_fact set_initial_state fluent_value with_init apply_fact set_location "
    "place_object set_position del_fact delete_fact clear_fact set_state set_value",
    "with_goal": "set_goal add_goal Goal want with_goals replace_goal change_goal set_objective update_goal new_goal set_target "
    "new_task achieve_goal",
    "without_goal": "without_goals remove_goal clear_goals delete_goal del_goal reset_goals no_goals drop_goal only_goal omit_goal",
    "plan": "solve search astar bfs policy heuristic replan Replanner Step Result query planner reach achieve optimise optimize "
    "solution solver plans repair redo resolve seek decompose think pyhop htn compute find_plan OneshotPlanner make_plan "
    "run_planner SequentialPlanner AnytimePlanner plan_scene solve_problem PlanResult TaskNetwork PlannerMode "
    "PlanGenerationResult PlanningEngine plan_motion plan_task plan_goal possible_plans all_plans plan_tree plan_again",
    "explain": "why explanation justify reasons because diagnose cause rationale background why_unsolvable why_no_plan",
    "verify": "run simulate simulation evaluate rollout physics sim pybullet check test validate valid success succeeded ok "
    "status failed verified verdict rerun repeat SequentialPlanValidator check_plan monte_carlo is_valid_plan simulate_plan "
    "run_simulation is_applicable outcome_of",
    "execute": "act step Agent dispatch perform tick Runner episode replay Executive Controller pick place grasp pour navigate "
    "drive apply do play loop spin go monitor progress send control transition reset done deploy ros publish call successor "
    "completed started restart rerun repeat retry carry real lookahead resume run_scene execute_plan rollout_plan run_plan "
    "move_base do_action apply_action perform_action perform_plan run_on_robot current_step simulate_steps "
    "continue_ through",
    "picture": "draw show plot render image visualise visualize view display viz map screenshot thumbnail diagram viewer figure "
    "svg preview sketch to_png print_map",
    "report": "open replay draw show plot render image picture visualise visualize view display html page dashboard gantt "
    "viewer figure video film movie animate browse write_report save_report plot_plan show_plan visualize_plan visualise_plan "
    "to_png save_video timeline_html",
    "serve": "server endpoint web app api rest host http browser open_page",
    "of": "init empty blank",
    "practise": "evaluate benchmark curve practice improve test score performance cross_val_score learning_curve",
    "classes": "kinds types sorts hierarchy taxonomy subclasses locations places cups rooms tables surfaces bottles containers "
    "user_types object_types is_a",
    "situations": "fluent predicate properties attributes features types object_properties data_properties observation_space "
    "state_variables",
    "affordances": "instances groundings afford applicable successors can possible reachable options ground_actions "
    "ground_behaviors legal_actions available_actions valid_actions action_mask feasible_actions applicable_operators "
    "actions_for find_actions",
    "print": "show display info describe statistics stats text print pretty string str summary signature format pprint "
    "description repr display_text to_string dump_text print_plan print_steps as_string as_text to_text",
    "save": "export dump write store serialize serialise json persist pickle commit to_file to_path to_owl_file write_file "
    "write_graph state_dict to_val sas_plan plan_file to_ttl save_json write_json save_episode to_turtle to_rdf",
    "read_plan": "from_file load_plan parse_plan open_plan plan_from_file from_plan plan_from_json from_json from_dict",
    "read_episode": "parse from_file load_episode load_execution open_episode from_json read_execution",
    "read_report": "parse from_file load_report load_verdicts load_verification from_json read_verdicts",
    "graph": "rdf networkx yaml rdflib turtle ttl statements quads n3 axioms neighbors neighbours labels comments annotations "
    "dataset tree nx digraph dot predicates_of to_dict to_json_ld value_of to_string knowledge_graph to_owl_xml "
    "namespaces_graph property_values",
    "cost": "value objective reward metric price quality score weight expense effort fitness expected plan_cost total_cost "
    "g_value total_reward step_cost",
    "seconds": "time duration runtime elapsed timing cpu clock total_time solve_time search_time metrics_time solver_time",
    "status": "reason state solved success succeeded ok found reached result code outcome planning_status return_code "
    "done_status",
    "reason": "why explanation unsolvable failure error message diagnosis failed why_unsolvable",
    "bound": "gap optimal optimality lower_bound proved_optimal best_cost",
    "search": "log nodes statistics stats expansions metrics expanded generated evaluated evaluations log_messages",
    "timed": "start time schedule makespan timeline temporal durations parallel concurrent end seconds begin finish interval t0 "
    "total_time timed_actions critical_path partial_order_plan",
    "steps": "list step expand nodes solution items body actions sequence first tasks behaviors behaviours children values root "
    "substeps refinement subplan decomposition subtasks primitive leaf verdicts results reports action_names step_names "
    "top_level abstract_plan to_plan first_step next_action get_steps sub_actions sub_steps sub_plan",
    "primitives": "commands atoms leaves flat flatten motions atomic leafs bottom lowest linear primitive_actions "
    "ground_actions low_level leaf_actions primitive_steps leaf_steps",
    "length": "depth levels len count size number height shape num_steps n_steps number_of_steps num_actions_total num_actions",
    "at_level": "level layer by_level level_steps steps_at",
    "why": "explain explanation justify reasons because goal justification causes purpose dependencies supports motivation "
    "rationale enables reason_for why_action reason_of causal_links depends_on needed_by needs_steps predecessors_of used_by "
    "expected_by",
    "why_not": "whynot contrast counterfactual alternative instead other why_isnt what_if second_best next_best compare_with",
    "labels": "names labelled words sentences captions verbalize say narrate natural_language describe_steps in_english",
    "certificate": "proof certify unsat_core",
    "to_dot": "draw plot render image visualise visualize figure graphviz pydot png",
    "json": "save write store serialize serialise dict dumps data raw asdict jsonable to_file to_yaml to_record",
    "to_dataframe": "table df pandas csv",
    "to_networkx": "graph hierarchy tree nx digraph dag causal_graph",
    "in_order": "reorder order sort permute swap shuffle reordered",
    "walk": "leaves iterate traverse iter visit descendants dfs preorder recursive all_steps all_actions flatten_all every_step",
    "index": "position find locate get find_step",
    "behavior": "name action behaviour operator schema kind skill verb type what action_name function_name",
    "arguments": "objects items location target domain robot values args parameters params operands inputs agent hand subject "
    "grounded signature arity terms s argument_names objects_involved",
    "level": "depth layer height abstraction tier level_number",
    "id": "identifier number index key uid uuid iri ident",
    "path": "position order address ancestors coordinates index_path location_in_tree",
    "preconditions": "applicable condition requires pre requirements guard precond needs when add_list",
    "effects": "result adds deletes changes post outcomes achieves postcondition consequences expected changed_facts "
    "delta_state post_conditions del_",
    "step": "label caption words verbalize sentence title display_name natural_language pretty_name human_readable",
    "name": "label id iri title",
    "reasons": "why error message why_failed failure_reason",
    "events": "history log items obs records timeline states observations seen messages feedback state_history",
    "failures": "problems failed faults exceptions failed_actions",
    "interventions": "disturbances perturbations surprises interrupts changes_of_the_world",
    "replans": "changes repairs replanning recoveries replan_count n_replans",
    "observed": "facts pose position location final current_state end_state state_after last_state robot_state",
    "course": "states trajectory state_history",
    "summary": "explain info describe message statistics stats metrics text print pretty string str",
    "learn": "step memory remember train fit teach add update put insert observe record append push reinforce backward "
    "store_plan learn_episode add_example experience_replay",
    "initial": "start init facts state fluent_values",
    "goal": "objective target tasks",
    "scene": "label name uri iri title",
    "failure": "explain why reason error failed fault cause failing failed_step failed_rollouts",
    "trusted": "assumed unverified unchecked assumptions",
    "poured": "amount filled spill volume",
    "table": "list show info describe rows json items episodes length len count size data dataframe df csv records stats "
    "cogency probability print confidence details measurements measured entries all summary likelihood scenes to_dict to_pandas "
    "to_records per_step step_results num_rules is_empty links_of",
    "ok": "valid success succeeded status result verified passed",
    "as_json": "to_dict",
    "situation": "name fluent predicate relation kind type property functor p",
    "deepcopy": "clone copy deepcopy duplicate fork snapshot",
    "==": "compare diff difference equals delta compare_to same_as",
}
"""Words of other libraries for the last name of an item in `OVERVIEW`, for all kinds of objects."""
HINTS: Mapping[str, Mapping[str, str]] = {
    "confab": {
        "scene.plan(engine=ENGINE)": "lama pyperplan enhsp tamer aries lpg ff engine fast_downward",
        "confab -v (in a shell)": "logging verbose debug logger quiet log_level set_verbosity",
        "confab run (in a shell), or scene.execute()": "run quickstart run_demo run_example",
        "confab.scenes()": "datasets samples examples catalog list registry ls builtin shipped names domains problems "
        "list_domains available_scenes get_scenes",
        "confab.validate(FILE)": "check reasoner pyshacl verify_file is_valid",
        "confab.new_domain(NAME)": "init new create scaffold template Action Behavior Behaviour Fluent Object Type Skill "
        "Predicate Operator define Situation build Pose Location Place Cup Bottle Hand Gripper Class Thing create_domain "
        "make_domain DurativeAction UserType add_action ObjectType ObjectProperty new_ontology",
        "confab.Memory.of(SCENE).learn(SCENE, PLAN)": "learn remember train fit demonstrate teach demo",
        "from confab.history import runs, compared": "runs history compare diff log experiments load_run read_runs list_runs",
        "confab.within(SECONDS)": "timeout limit deadline budget set_time_limit set_timeout TimeLimit",
        "scene.to_pddl()": "PDDLWriter export to_pddl write_pddl export_pddl save_pddl",
        "confab import DOMAIN.pddl PROBLEM.pddl -o SCENE.ttl (in a shell)": "PDDLReader convert pddl read_pddl load_pddl "
        "parse_problem import_",
        "help(confab)": "help info doc man usage about describe",
        "scene.plan().save(FILE)": "save dump write store export_plan to_json to_file",
        "confab mcp (in a shell)": "mcp tools agents llm",
        "confab.generate(FAMILY)": "synthetic families make_scene",
        "scene.plan().plan, or scene.read_plan(FILE)": "Plan SequentialPlan",
        "scene.read_plan(FILE)": "plan_from_file from_plan",
        "scene.to_unified_planning()": "shortcuts",
        "confab.KnowledgeError": "Error exception",
        "scene.graph": "graph triples",
        "scene.owl": "onto_path",
        "scene.board()": "edit",
        "__version__": "version",
        "confab export SCENE --bt (in a shell)": "BehaviorTree BehaviourTree bt btcpp py_trees behavior_tree",
        "confab --help (in a shell)": "main cli commands",
        "confab fetch URL (in a shell)": "fetch download pull",
        "scene.embodiment.robots": "Arm robot",
        "scene.plan()": "search",
        "confab.Memory.load(FILE)": "Experience memory load_memory",
        "scene.with_goal(FACT)": "goals",
    },
    "scene": {
        "title": "label name caption heading labelled comment display_name description_text",
        "knowledge.prefixes": "namespace prefix ns bind prefix_map",
        "graph.remove(TRIPLE)": "remove delete destroy delete_object delete_individual",
        "graph.add(TRIPLE)": "spawn extend add_action set_pose add_triple add_object new_individual add_instance insert_object "
        "create_object add_node add_edge add_class add_behavior add_fluent add_statement add_rule add_axiom add_constraint "
        "add_location add_robot add_type add_property parse_into",
        "problem": "ground up_problem planning_problem task_definition",
        "confab export SCENE --bt (in a shell)": "behaviortree bt tree btcpp xml behavior_tree py_trees",
        "read_result(FILE)": "load_result open_result explain_plan_file result_from_file",
        "owl": "owlready2 owlready ontology onto world default_world load_owl",
        "embodiment": "agents body urdf gripper joints geometry kinematics meshes poses workspace links arm camera shapes hands "
        "sensors table",
        "iri": "uri identifier base url id",
        "knowledge.path": "path file filename source folder",
        "board()": "dashboard widget gui editor ui interactive notebook",
        "confab.load(SOURCE)": "open read parse make new create build load reload include reset restore undo load_ontology "
        "from_file from_string from_text from_name import_ontology from_pddl load_world from_graph from_rdf import_file "
        "from_ttl from_json from_dict from_path from_url from_scene from_yaml from_owl",
        "confab.validate(FILE)": "problems check lint shacl consistent errors violations validate valid warnings consistency "
        "inconsistent_classes",
        "confab.generate(FAMILY)": "random generate sample random_scene",
        "confab.Memory.of(scene).learn(scene, plan)": "memory learn remember train fit teach experience",
        "execute().reached": "done success succeeded reward",
        "facts == other.facts (confab plan SCENE --diff OLD says what changed in the plan)": "equals delta compare diff "
        "difference compare_to same_as",
        "[goal for goal in scene.goals if goal not in scene.facts + scene.derived_facts]": "satisfied unsatisfied_goals "
        "unmet_goals open_goals check_goal goals_met is_goal goal_reached is_done remaining_goals",
        "knowledge.files": "imports files sources owl_imports imported_ontologies",
        "plan(memory=FILE)": "load_memory use_memory set_memory with_memory",
        "verify(seed=SEED)": "seed rng set_seed random_seed",
        "problem.domain.rules": "rules swrl derived axioms_rules",
        "verify(video=FILE)": "video film movie record animate gif save_video",
        "graph.update(TEXT)": "sparql_update update_query execute_update run_update insert_data delete_data",
        "plan().plan.to_networkx(), or graph": "nodes edges networkx",
        "problem.relations": "relation",
        "problem.domain": "domain",
        "to_pddl()": "pddl to_domain",
        "export(FOLDER)": "write_pddl save_pddl dump_pddl",
        "to_unified_planning()": "up unified_planning",
        "with_episodes(FILE)": "history log add_episode",
        "embodiment.robots": "robot",
        "plan().save(FILE)": "save_plan write_plan",
        "plan().cost": "quality_metrics cost",
        "plan().solved": "unsolvable has_plan",
        "applicable_query(BEHAVIOR)": "show_query get_query precondition_query",
        "plan(time_limit=SECONDS)": "timeout deadline time_limit",
        "problem.domain.levels": "level depth",
        "problem.domain.constraints": "constraints",
        "confab.practise(…)": "benchmark curve evaluate_memory",
        "graph": "to_turtle json",
        "execute()": "run apply goto",
        "plan()": "find_path plan_path",
        "plan().why(STEP), or explain() for all steps": "why",
        "plan().why_not(WHAT)": "why_not whynot",
    },
    "result": {
        "result[WORDS]": "find find_step locate",
        "plan": "best best_plan final_plan first_plan",
        "scene.graph": "rdf triples rdflib turtle to_ttl",
        "solved": "solvable feasible done success succeeded ok found reached finished has_plan valid_plan is_sat well went "
        "worked",
        "verify().video": "video film movie record animate gif mp4 save_video",
        "purposes": "links dependencies causal supports causal_links",
        "scene.read_result(FILE)": "read parse load from_file load_plan read_plan from_json from_dict",
        "confab.Memory.of(scene).learn(scene, result)": "memory learn remember train teach",
        "outcome.forgone": "unmet violated preferences unsatisfied soft_goals",
        "problem.initial": "init facts initial initial_state start_state state_before",
        "faults(PLAN)": "problems errors violations is_valid_plan check_faults check_plan_for",
        "execute().episode.observed": "final_state end_state state_after goal_state_reached",
        "execute().episode.course": "states trajectory state_sequence state_history",
        "dearer()": "warning hints suggestions cheaper is_cheapest",
        "plan.to_records()": "records list to_records",
        "confab export SCENE --bt (in a shell)": "behavior_tree export_bt to_behavior_tree to_xml",
        "outcome.engine": "planner solver engine_name",
        "plan.walk()": "walk_steps all_steps",
        "json()": "serialize serialise model_dump",
        "execute()": "run start",
        "scene.plan(GOALS)": "again next",
        "outcome.bound": "is_optimal is_best",
        "why(STEP), or explain()": "explanation",
    },
    "plan": {
        "result[WORDS]": "find find_step get locate",
        "result.purposes": "constraints dependencies ordering causal_links adjacency_list",
        "scene.plan(GOALS) (plans aren't edited)": "replan add update edit change insert replace remove delete extend map "
        "repair concatenate append pop substitute refine splice clear concat merge join plus push unshift set_step",
        "confab export SCENE --bt (in a shell)": "behaviortree bt btcpp xml behavior_tree py_trees",
        "confab.Memory.of(scene).learn(scene, plan)": "memory learn remember train teach",
        "plan[-1]": "last tail end final last_step",
        "plan[0]": "head first first_step root_step",
        "plan[NUMBER]": "at nth item getitem get_step step_at step_number goto jump",
        "[step for step in plan.walk() if …]": "search query select where filter find_all steps_of",
        "scene.facts": "init initial initial_state start_state",
        "step in plan": "has contains includes is_in has_step",
        "result.outcome.bound": "proven",
        "to_records()": "rows to_dicts",
        "result.solved": "success ok status",
        "result.goals": "task goal",
        "result.problem": "domain problem environment",
        "scene.to_pddl()": "pddl",
        "result.execute().episode.observed": "resulting_state outcome_state",
        "steps": "plan",
        "json()": "serialize",
        "scene.execute(plan)": "run start next",
        "scene.read_plan(FILE)": "open",
        "length": "n_levels",
        "scene.with_goal(FACT)": "remove_goal",
        "scene.verify(plan)": "executable",
    },
    "step": {
        "bindings": "variables substitution assignment env free_variables",
        "rank": "score cogency weight priority probability",
        "plan.index(step)": "successors next previous prev predecessors before after sibling",
        "result.plan[step.path[:-1]]": "up parent owner container",
        "scene.behaviors[step.behavior].cost": "action_cost",
        "result.problem": "state domain world",
        "walk()": "primitives",
        "scene.execute(plan)": "run",
        "result.save(FILE)": "to_file save",
    },
    "schedule": {
        "makespan": "cost length duration end total_time",
        "slots": "items actions steps entries intervals bars",
    },
    "execution": {
        "reached": "solved done success succeeded terminated truncated ok finished result verified complete achieved passed "
        "goal_reached",
        "episode": "rollout history log record trajectory transcript steps_taken",
        "plan.length": "length count size n_steps",
        "scene.execute(world=WORLD)": "simulate simulation world robot environment env backend",
        "plan": "items primitives path actions steps executed done_plan trace executed_steps performed action_history "
        "current_plan last_plan final_plan",
        "result.cost": "returns",
        "violations": "constraints",
        "confab export SCENE --trajectory FILE (in a shell)": "joints motions joint_positions",
        "episode.events": "observed",
        "episode.failures": "error",
        "json()": "serialize serialise",
        "summary()": "message",
        "scene.read_episode(FILE)": "load read open",
        "episode.observed": "state",
        "scene.execute()": "again",
    },
    "episode": {
        "done": "plan actions steps executed trace performed executed_steps",
        "len(episode.events)": "length count size n_steps",
        "scene.execute()": "run execute replay resume",
        "planned": "first_plan original_plan initial_plan",
        "observed": "state",
        "reasons": "reason",
    },
    "report": {
        "verified": "valid solved feasible success succeeded ok reached status result verdict passed outcome correct good_plan",
        "rollouts": "samples runs items episodes trials simulations verdicts results each attempts",
        "rate()": "score probability accuracy reliability percentage mean confidence average",
        "good": "count successes n_success num_success n_successes n_passed succeeded_count number_of_successes",
        "video": "render film movie record animate gif mp4 frames watch clip save_video video_path",
        "rollouts[0].cpu_seconds": "time duration runtime elapsed seconds",
        "json()": "data",
        "table()": "steps",
        "result.report(FILE)": "show",
        "scene.read_report(FILE, PLAN)": "open",
        "scene.verify(plan)": "again",
    },
    "rollout": {
        "cpu_seconds": "time duration runtime elapsed seconds",
        "state": "facts observed",
    },
    "verdict": {
        "message": "why explanation reason text description",
        "measured": "metrics values measurements numbers",
        "code": "kind failure error",
    },
    "memory": {
        "teach(RESULT)": "demonstrate imitate demonstration show_plan",
        "live(PROBLEM, EPISODE)": "online add_execution learn_online learn_execution",
        "merge(OTHER)": "extend concat join plus combine union share sync add_memory update_from",
        "advice()": "policy rules preferences parameters params advise suggest recommend weights learned insights predict best "
        "model coefficients what_learned coef_ knowledge recall",
        "confab.Memory.of(SCENE) (a new memory)": "remove delete reset clear forget wipe erase unlearn drop prune empty_out",
        "page()": "draw plot visualise visualize view display report html dashboard",
        "confab.Memory.of(SCENE)": "make new create for_scene from_scene",
        "scene.plan(memory=memory)": "apply use guide rank query search",
        "table().csv()": "csv export_csv save_csv",
        "trust(REPLICAS)": "trusted",
    },
    "table": {
        "dataframe()": "plot df pandas sort filter frame groupby pivot to_numpy sort_values to_excel",
        "csv()": "export save dump write to_file",
        "records()": "json dict data asdict bindings to_list",
        "[*table]": "list fetch rows items head sample first tail results all fetchall tolist fetchone itertuples iterrows one "
        "scalar single values_list",
        "len(table)": "length count size shape nrows num_rows n_rows",
        "columns": "names variables vars header keys fields",
        "truth": "ask answer boolean bool yes",
        "dataframe().to_html()": "html",
    },
    "problem": {
        "individuals": "objects instances things items constants user_objects",
        "relations": "static static_facts",
    },
    "domain": {
        "rules": "axioms derived derived_predicates",
        "constraints": "invariants",
    },
    "behaviour": {
        "parameters": "objects args params inputs arguments signature",
        "variables": "bindings determined",
        "timing": "time duration",
        "scene.quantifying_query(NAME)": "query sparql",
        "effects": "add_list",
        "scene.affordances(OBJECT)": "applicable",
    },
    "situation": {
        "range": "options kind values type codomain domain_of_values",
        "properties": "predicate",
        "default": "initial",
    },
    "fact": {
        "symbol": "fluent key variable atom lhs",
        "value": "object target values o rhs",
    },
    "outcome": {
        "plan": "actions steps solution",
    },
}
"""Words of other libraries for a name of one kind of object only; they take precedence over `WORDS`."""
COMMANDS = {
    "plan": "solve search find compute think astar replan goal planner make-plan",
    "plan --diff OLD_SCENE": "diff changes delta",
    "run": "demo all main pipeline start quickstart example tutorial hello everything launch go bringup",
    "verify": "simulate simulation sim physics rollout rollouts evaluate eval val test check-plan validate-plan verify-plan",
    "execute": "act do play perform dispatch exec loop control monitor tick replay send drive resume repair step move react "
    "recover run-plan execute-bt",
    "explain": "why whynot reason reasons justify because diagnose contrast explain-plan",
    "learn": "train fit teach practise practice demonstrate imitate training demo-learn",
    "memory": "experience mem rules memories forget knowledge",
    "report": "html page visualize visualise show view render plot display present gantt print write-report plan-report",
    "runs": "history compare log logs experiments results past mlflow track previous list-runs diff-runs",
    "query": "ask sparql select triples rdf q get arq individuals where search-graph",
    "query SCENE --facts": "facts state find-facts list-facts objects locations initial-state describe inspect",
    "query SCENE what-is-wanted": "goals list-goals",
    "query SCENE --derived": "derived-facts inferred-facts",
    "query SCENE --affords all": "affordances applicable affords actions possible",
    "query SCENE --show BEHAVIOR": "behaviors behaviours operators skills show-query",
    "serve": "server web ui gui app endpoint dashboard live host http watch browser board open webui edit interactive rviz "
    "viewer api up notebook daemon studio start-server",
    "mcp": "agent agents llm tools chat assistant claude mcp-server",
    "picture": "draw image map diagram png svg screenshot graph visual dot graphviz classes figure hierarchy tree picture-of",
    "validate": "check lint shacl consistency reasoner doctor consistent infer errors format fmt hermit validate-file "
    "verify-file test-scene",
    "new": "init create scaffold startproject template begin make bootstrap add setup skeleton create-domain new-domain "
    "new-project new-ontology start-domain create-scene-file",
    "generate": "gen random synth sample bench benchmark build families make-scene generate-scenes",
    "convert": "transform translate rewrite to-sparql convert-behaviors",
    "fetch": "download pull install wget update imports get-ontology clone-ontology add-import",
    "import": "load pddl2owl parse upload from-pddl pddl-import",
    "export": "pddl save trajectory dump write export-pddl",
    "scenes": "list ls examples info catalog domains available datasets problems inventory status stat levels "
    "worlds envs samples about show-scenes objects-of",
    "--help": "help usage man manual commands docs ?",
    "--version": "version ver",
    "--completion SHELL": "completion completions install-completion",
    "plan --optimal": "optimize optimise optimal shortest cheapest best",
    "verify --video OUT.mp4": "film video record movie animate animation gif",
    "plan --minimise makespan": "schedule makespan timeline parallel temporal",
    "export --bt": "bt behaviortree behavior-tree behaviour-tree",
    "execute --intervene": "interrupt disturb intervene perturb inject",
    "execute --on INTERFACE:ADDRESS": "robot robots connect ros ros2 hardware real",
    "plan --memory FILE": "use-memory plan-with-memory",
    "python -c 'import confab'": "shell repl console ipython python interactive-shell",
}
"""The names of the commands, each with other words for it."""
OPTIONS = {
    "time_limit seconds": "max_expansions max_nodes node_limit expansion_limit max_evaluations max_iterations timeout max_time "
    "deadline limit time max_seconds time_out budget t duration max_planning_time overall_time_limit search_time_limit "
    "max_runtime wall_time seconds sec timelimit",
    "rollouts": "trials runs n episodes repeat num_rollouts iterations times samples n_rollouts num_episodes repetitions "
    "repeats n_episodes tries attempts n_trials k num_trials",
    "rounds": "epochs iterations episodes repeat n_rounds n passes repeats",
    "seed": "random_seed rng random_state s seeds",
    "format": "fmt output_format csv results type as tsv f",
    "json": "format fmt json_output as_json output_format machine to_json print_json structured jsonl pretty indent text stdout",
    "output path folder": "html save_plan out outfile output_file out_dir save write dest to output_dir directory destination "
    "out_file file target result_file plan_file save_to dir sas_plan output_folder o outdir output_path filename file_name",
    "report": "html page visualize visualise web show_html view render plot html_report show open pretty browser",
    "video": "film movie record record_video mp4 save_video video_file animation gif capture",
    "gui watch": "render viewer window show display visualise visualize human headless gui_on interactive use_gui render_mode",
    "without_goal": "no_goals no_goal remove_goal drop_goal clear_goals only_goal only replace_goals",
    "fact": "facts with_fact set state init initial initial_state assume given",
    "goals goal": "target task objective goal_state set_goal targets new_goal want desired goal_facts tasks to_achieve",
    "memory": "experience knowledge model learned mem use_memory memory_file with_memory checkpoint weights learned_from use",
    "no_memory": "without_memory no_learning fresh memoryless",
    "engine mode": "planner",
    "engine": "solver backend heuristic search_engine up_engine planner_name fast_downward external algorithm search use",
    "mode": "strategy algorithm alias method search_mode policy config variant heuristic search",
    "optimal minimise": "optimise optimize best shortest cost_optimal anytime optimality minimum_cost cheapest "
    "optimality_guarantee is_optimal find_optimal",
    "minimise": "minimize metric quality_metric criterion cost makespan minimise_cost quality objective",
    "interventions intervene": "intervention disturb disturbance event interrupt disturbances inject events change surprise "
    "perturbation",
    "world": "sim simulator simulation env environment real physics backend pybullet use_physics simulate in_world",
    "on": "robot connect interface hardware ros host address adapter driver",
    "serve": "port web live http web_port",
    "port": "p http_port address bind listen server_port host",
    "workers": "jobs j threads processes parallel n_jobs cores cpus num_workers nproc num_threads n_workers procs concurrency",
    "noise": "sigma std stddev noise_level sensor_noise error perception_noise",
    "perturb": "randomise randomize domain_randomization vary jitter perturbation random perturbations disturb robust",
    "verbose": "debug log log_level loglevel trace verbosity logging info vv",
    "quiet": "silent no_output no_log no_progress",
    "not": "why_not instead alternative whynot but contrast",
    "observed from_observed": "init initial state start from_state initial_state observation from start_state current_state "
    "observations",
    "level": "depth layer abstraction levels abstraction_level",
    "leave_levels levels": "strict free hierarchy strict_levels",
    "scene iri": "iri name problem scene_iri graph named_graph uri",
    "source": "path file filename uri url scene address location name graph text data input",
    "plan": "plan_file input_plan from_plan solution sas_plan action_list steps initial_plan",
    "objects": "n_objects num_objects size n cups count number",
    "hands": "arms n_hands robots grippers n_arms num_hands",
    "clutter": "distractors irrelevant extra obstacles distraction",
    "strict": "werror error fail_on_warning warnings_as_errors pedantic",
    "deep": "hermit reasoner full owl consistency pellet thorough dl",
    "bt": "behavior_tree behaviour_tree behaviortree tree btcpp py_trees xml",
    "trajectory": "trajectories joints motion paths joint_trajectory",
    "affords": "affordances object applicable actions what_can of",
    "observer": "callback on_step listener hook on_event callbacks subscriber",
    "watch": "live follow show display render visualize animate",
    "perturbed": "randomised",
    "keep": "history save_run store archive track log_run",
    "no_video": "skip_video no_film without_video headless fast no_record no_physics quick",
    "learn": "train remember update_memory learning fit",
    "rows": "limit max_rows n head top max_results",
    "diff": "compare changes against_scene delta difference",
    "instead": "step replace at in_place_of",
    "family": "kind type name template scenario",
    "behavior": "action operator skill behaviour name",
}
"""The names of the parameters in Python, each with other words for it. The option of a parameter has the parameter's name, with
``--`` before the name and ``-`` in place of ``_``.

If a key contains several names, the first one that the called function or command accepts is suggested.
"""
NEEDLESS = {
    "a call returns one plan; result.why_not(WHAT) and scene.plan(optimal=True) look for others": "k n n_plans num_plans "
    "number_of_plans top_k alternatives diverse all_plans max_plans",
    "state the values of a variable in the query: VALUES ?x { :cup1 }": "bindings binding initbindings init_bindings "
    "substitutions values params parameters variables vars",
    "scene.with_fact(FACT) returns a scene with another fact": "fact facts",
    "scene.without_goal() returns a scene without goals, to plan for other goals only": "only replace_goals only_goals no_goals "
    "without_goal clear_goals",
    "confab learn, and memory.learn(EXECUTION), learn from plans and executions": "learn learning train",
    "the query what-is-wanted lists the goals": "goals list_goals",
    "the same call gives the same result in every process": "seed random_seed random_state rng set_seed",
    "the option -v of a command prints the duration of each stage": "verbose verbosity debug log_level loglevel log "
    "show_progress progress_bar",
}
"""Reasons why some functions and commands don't have a parameter, each with names for such a parameter."""
