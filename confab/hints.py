"""Names that users of other libraries may try, and the functions of Confab that these users mean.

Each table belongs to a kind of object. A key is an expression of Confab; the value contains other names with the same meaning.
`confab.guessing` compares whole names first, then the words of the names: variants of a listed name with a filler or another
ending (``get_plan``, ``plans``) needn't be listed.
"""

from __future__ import annotations

from collections.abc import Mapping

MODULE = {
    "confab.load(SCENE).plan(engine=ENGINE)": "lama fast_downward pyperplan enhsp tamer aries lpg ff engine",
    "confab -v (in a shell)": "set_log_level logging verbose debug log_level set_verbosity logger quiet",
    "confab run (in a shell), or confab.load(SCENE).execute()": "run run_demo run_example quickstart",
    "confab.load(SCENE)": "load_ttl read_owl load_rdf open read read_scene load_scene load_file load_ontology "
    "from_file parse World Ontology Problem Graph KnowledgeGraph Environment Env connect from_string from_text loads "
    "load_domain load_problem Domain Task get_scene import_scene open_scene SceneLoader Loader make gym Kitchen "
    "reader OWLReader Model Dataset Store kb infer knowledge_base PlanningProblem from_name SceneGraph "
    "import_ontology",
    "confab.scenes()": "list_scenes list_examples available_scenes datasets samples examples catalog list all_scenes "
    "registry ls builtin shipped names list_domains domains problems get_scenes scene_names",
    "confab.load(SCENE).plan()": "plan solve search find_plan Planner OneshotPlanner make_plan run_planner "
    "SequentialPlanner AnytimePlanner astar bfs Solver policy heuristic TaskPlanner plan_scene compute_plan "
    "solve_problem replan Replanner Step Result PlanResult TaskNetwork PlannerMode PlanGenerationResult "
    "PlanningEngine",
    "confab.load(SCENE).query(TEXT)": "query ask sparql select SparqlQuery run_query execute_query question "
    "prepareQuery",
    "confab.load(SCENE).verify()": "verify simulate simulation PlanValidator SequentialPlanValidator check_plan "
    "evaluate rollout physics sim pybullet test_plan verify_plan Verifier",
    "confab.load(SCENE).execute()": "execute act step Agent run_scene execute_plan dispatch perform tick rollout_plan "
    "run_plan start Runner BehaviorTree episode Monitor act_loop replay Executive Controller",
    "confab.load(SCENE).explain()": "explain why explanation justify why_not reasons",
    "confab.load(SCENE).picture()": "draw show plot render image picture visualise visualize view display viz Viewer "
    "plot_scene draw_scene",
    "confab.load(SCENE).plan().report(FILE)": "report html page write_report dashboard save_report plot_plan "
    "show_plan visualize_plan visualise_plan gantt",
    "confab.load(SCENE).serve()": "serve server endpoint start_server web app api rest",
    "confab.validate(FILE)": "check lint verify_file validate_scene shacl Validator is_valid consistent sync_reasoner "
    "reasoner check_scene validate_file validate_ontology pyshacl check_consistency",
    "confab.generate(FAMILY, …)": "make_scene random_scene generate_scene Generator random synthetic families",
    "confab.new_domain(NAME)": "new_ontology create_domain init new create make_domain scaffold template new_scene "
    "create_scene Action Behavior Behaviour Fluent Object Type Skill Predicate Operator InstantaneousAction "
    "DurativeAction define UserType add_action Situation build Pose Location Place Cup Bottle ObjectType Hand Gripper "
    "Class ObjectProperty Thing",
    "confab.load(SCENE).plan().plan, or confab.load(SCENE).read_plan(FILE)": "Plan SequentialPlan",
    "confab.load(SCENE).read_plan(FILE)": "load_plan read_plan parse_plan open_plan plan_from_file from_plan",
    "confab.load(SCENE).read_episode(FILE)": "load_episode read_episode load_execution open_episode",
    "confab.load(SCENE).read_report(FILE, PLAN)": "load_report read_report load_verdicts load_verification",
    "confab.Memory.load(FILE)": "load_memory read_memory open_memory Experience memory load_experience",
    "confab.Memory.of(SCENE).learn(SCENE, PLAN)": "learn remember train fit demonstrate teach "
    "learn_from_demonstration demo_learn demo",
    "from confab.history import runs, compared": "runs history compare diff compare_runs compare_plans load_run "
    "read_runs list_runs log experiments",
    "confab.within(SECONDS)": "timeout set_time_limit limit deadline set_timeout budget TimeLimit",
    "confab.load(SCENE).to_pddl()": "to_pddl PDDLWriter write_pddl export export_pddl save_pddl",
    "confab.load(SCENE).to_unified_planning()": "unified_planning up shortcuts",
    "confab import DOMAIN.pddl PROBLEM.pddl -o SCENE.ttl (in a shell)": "PDDLReader read_pddl from_pddl import_pddl "
    "load_pddl parse_pddl convert pddl parse_problem import_",
    "confab.KnowledgeError": "Error ConfabError PlanningError ParseError errors SceneError NotFoundError exception",
    "confab.load(SCENE).with_fact(FACT)": "Fact add_fact set_fact add update assert_fact set",
    "confab.load(SCENE).with_goal(FACT)": "Goal add_goal set_goal goals",
    "confab.load(SCENE).objects": "objects individuals Individual instances",
    "confab.load(SCENE).graph": "graph rdf triples to_graph ConjunctiveGraph",
    "confab.load(SCENE).owl": "owl onto_path owlready2 default_world",
    "confab.load(SCENE).board()": "board widget gui edit editor ui",
    "__version__": "version",
    "help(confab)": "help info doc man usage about describe",
    "confab.load(SCENE).verify(seed=SEED)": "seed set_seed random_seed rng",
    "confab.load(SCENE).plan().save(FILE)": "save dump write save_plan export_plan store to_json to_file",
    "confab.practise(…)": "benchmark curve practice improve",
    "confab mcp (in a shell)": "mcp tools agents llm",
    "confab --help (in a shell)": "main cli command_line commands",
    "confab fetch URL (in a shell)": "fetch download pull",
    "confab.load(SCENE).embodiment.robots": "Robot Arm arms",
    "confab.load(SCENE).facts": "facts State initial_state",
}
COPY = "copy clone duplicate deepcopy fork snapshot"
COMPARE = "diff compare difference compare_to equals is_equal same_as delta"
SHOW = (
    "print show display pretty pretty_print to_string str string format text pprint dump_text print_plan print_steps describe "
    "description summary info repr signature as_string as_text to_text"
)
SCENE = {
    "title": "label name caption heading display_name labelled get_title comment description_text",
    "knowledge.prefixes": "prefixes namespace prefix ns prefix_map bind ",
    "save(FILE)": "save_state save_to to_path serialize serialise write dump write_ttl to_file save_as store "
    "export_owl to_owl_file export_ttl save_scene write_file write_graph to_turtle_file",
    "query(TEXT), which reads inferred facts": "sync_reasoner inferred inferred_graph infer reason run_reasoner entailments "
    "entailed materialize materialise closure owlrl expand",
    "query(TEXT), or plan()": "search",
    "query": "ask sparql select sparql_query execute_query run_query search_one rows fetch question queries "
    "get_results",
    "with_fact": "add_fact set_fact set add assert_fact update change tell put set_value set_initial_value insert "
    "assume modify set_init set_state assign replace with_facts set_property edit set_initial update_fact add_init "
    "observe_fact set_initial_state move fluent_value with_init without patch apply_fact set_location place_object "
    "set_position teleport put_object move_object",
    "with_fact(FACT), which states another value, or false": "remove_fact retract del_fact delete_fact without_fact "
    "clear_fact",
    "with_goal": "set_goal add_goal with_goals replace_goal remove_goal change_goal set_task set_objective "
    "clear_goals delete_goal del_goal update_goal new_goal add_task reset_goals set_target new_task want achieve_goal",
    "graph.remove(TRIPLE)": "remove delete remove_object remove_triple delete_object destroy_entity remove_individual "
    "remove_node delete_individual destroy",
    "graph.add(TRIPLE)": "set_pose add_triple add_object add_individual new_individual add_instance insert_object "
    "create_object add_node add_edge add_class add_behavior add_action spawn add_fluent add_statement add_rule "
    "add_axiom add_constraint add_location add_robot add_type add_property parse_into extend",
    "plan().plan.to_networkx(), or graph": "nodes edges networkx",
    "graph": "named_graphs yaml rdf to_graph rdflib predicates_of json to_dict to_json_ld turtle ttl "
    "value_of statements quads to_string n3 knowledge_graph axioms neighbors "
    "neighbours labels comments annotations to_owl_xml dataset namespaces_graph property_values",
    "plan": "find_path plan_path plan_motion solve find_plan make_plan planner run_planner replan compute_plan astar "
    "policy find_solution plan_task reach achieve optimise optimize solution solver plan_goal plans possible_plans "
    "all_plans plan_tree",
    "verify": "simulate simulation check_plan validate_plan physics rollout verify_plan test monte_carlo "
    "is_valid_plan sim simulate_plan evaluate test_plan run_simulation check_physics",
    "execute": "pick place grasp pour move_base navigate drive goto run act apply step dispatch perform tick "
    "execute_plan run_plan do play replay rollout_plan start loop tick_once spin go monitor run_episode progress "
    "do_action apply_action send control perform_action simulate_action transition",
    "explain": "why why_not justify explanation reasons explain_plan because whynot why_unsolvable diagnose "
    "why_no_plan explain_unsolvable",
    "objects": "world_objects worldobjects individuals instances things entities objects_of_type nodes_of_type "
    "members subjects_of items object user_objects get_instances names_of_objects constants list_objects bodies "
    "search_objects find_object object_names names_of",
    "facts": "planning_scene pose position location position_of head start_state perceive sense state initial "
    "initial_state init observe explicit_initial_values "
    "initial_value initial_facts holds true_facts world_state fact value belief is_true check_fact fluent_values "
    "current_facts init_state atoms initial_defaults literals static_facts obs get_obs get_property predicate_values "
    "where get_location location_of current_state is_holding current has pretty_facts state_dict "
    "fact_list",
    "goals": "goal_test goal_state get_goals task goal goal_facts objective desired wanted goal_conditions target "
    "goal_description current_goal goal_list list_goals",
    "picture": "draw show plot render image visualise visualize to_png view display map draw_scene screenshot "
    "thumbnail diagram show_scene viewer figure svg print_map",
    "behaviors": "skills get_actions action action_space behavior behaviour operator schema capabilities "
    "get_behaviors action_names methods preconditions action_schemas effects list_actions abilities primitives "
    "primitive_actions durative_actions",
    "problem.domain.situations": "situation_types fluent predicate properties object_properties data_properties "
    "situation observation_space attributes state_variables features",
    "problem.relations": "static relation",
    "problem.classes": "kinds classes types sorts user_types hierarchy taxonomy class_tree type_hierarchy subclasses "
    "object_types get_class is_a class_hierarchy get_types list_classes locations places cups rooms tables "
    "surfaces bottles containers",
    "problem.domain": "domain domain_name",
    "problem": "up_problem planning_problem as_problem task_definition ground",
    "to_pddl()": "pddl domain_pddl problem_pddl to_domain",
    "export": "write_pddl save_pddl export_pddl dump_pddl",
    "to_unified_planning()": "unified_planning up to_unified",
    "read_episode(FILE)": "load_episode open_episode parse_episode load_execution read_execution",
    "read_report(FILE, PLAN)": "load_report load_verdicts read_verdicts load_verification",
    "read_result(FILE)": "load_result open_result read_plan_result result_from_file explain_plan_file",
    "read_plan(FILE)": "load_plan open_plan parse_plan from_plan plan_from_file plan_from_json",
    "with_episodes(FILE)": "add_episode load_history history episodes log",
    "affordances": "ground_operator ground_actions ground_behaviors groundings afford possible_actions applicable "
    "applicable_actions legal_actions available_actions valid_actions action_mask get_legal_actions successors can "
    "can_do possible feasible_actions applicable_operators reachable get_affordances what_can_i_do actions_for "
    "options find_actions",
    "owl": "owlready ontology onto world to_owl owlready2 default_world load_owl",
    "embodiment.robots": "robot robot_model",
    "embodiment": "body urdf gripper joints geometry kinematics meshes poses workspace links arm agents camera shapes "
    "hands sensors table",
    "iri": "ontology_iri get_iri uri base_iri identifier base url id",
    "knowledge.path": "path file filename source folder",
    "serve": "endpoint server start_server web api host http app rest open_page browser",
    "board": "widget editor interactive gui ui dashboard notebook",
    "construct": "constructs",
    "confab.load(SOURCE)": "load_world import_ontology load_ontology load open read parse from_file load_scene "
    "from_string from_graph load_file from_rdf reload import_file from_pddl from_ttl read_file from_json from_dict "
    "from_path from_url include reset restore undo from_name create make build new from_scene from_yaml from_owl "
    "from_text",
    "confab.validate(FILE)": "check violations shacl_report validate check_consistency consistent lint shacl errors "
    "valid warnings check_scene inconsistent_classes problems consistency",
    "confab.generate(FAMILY)": "generate random sample random_scene",
    "confab.Memory.of(scene).learn(scene, plan)": "learn memory train experience fit remember teach",
    "plan().report(FILE)": "report html page write_report save_report",
    "plan().save(FILE)": "save_plan write_plan",
    "plan().cost": "cost plan_cost quality_metrics",
    "plan().solved": "solvable solved has_plan unsolvable feasible",
    "execute().reached": "done success succeeded terminated truncated reward",
    "with_fact(FACT) (returns a changed copy), or copy.deepcopy(scene)": COPY,
    "facts == other.facts (confab plan SCENE --diff OLD says what changed in the plan)": COMPARE,
    "export --bt (in a shell)": "behavior_tree behaviortree bt tree btcpp py_trees xml",
    "applicable_query(BEHAVIOR)": "show_query get_query precondition_query",
    "plan(time_limit=SECONDS)": "timeout time_limit set_time_limit set_timeout deadline",
    "print(scene)": "print pretty describe info summary display_text to_text repr stats statistics",
    "[goal for goal in scene.goals if goal not in scene.facts]": "unsatisfied_goals unmet_goals open_goals check_goal "
    "goals_met satisfied is_goal goal_reached is_done goal_satisfied remaining_goals",
    "knowledge.files": "imports files owl_imports sources imported_ontologies",
    "plan(memory=FILE)": "use_memory set_memory with_memory load_memory",
    "verify(seed=SEED)": "seed set_seed random_seed rng",
    "problem.domain.levels": "level n_levels depth num_levels abstraction_levels",
    "problem.domain.rules": "rules swrl horn_rules derived axioms_rules derived_predicates",
    "problem.domain.constraints": "constraints",
    "verify(video=FILE)": "video film movie record animate save_video gif",
    "confab.practise(…)": "benchmark evaluate_memory curve",
    "graph.update(TEXT)": "sparql_update update_query execute_update run_update insert_data delete_data",
    "to_unified_planning().kind": "kind problem_kind",
}
RESULT = {
    "save(FILE)": "to_val sas_plan plan_file",
    "plan": "best_plan final_plan first_plan",
    "scene.graph": "rdf rdflib triples turtle to_ttl",
    "plan.steps": "actions action_list sequence action_names step list_actions action_sequence solution step_names "
    "top_level first abstract_plan to_plan first_step next_action",
    "plan.primitives": "primitives leaves low_level flat flatten primitive_actions commands motions atomic "
    "lowest_level ground_actions leaf_actions primitive_steps leaf_steps leafs bottom",
    "plan.length": "length levels plan_length num_steps n_steps number_of_steps len count size num_actions depth "
    "number num_actions_total",
    "plan.at_level(LEVEL)": "level at_level steps_at_level by_level level_steps",
    "solved": "success succeeded is_solved ok found has_plan solvable feasible valid_plan done is_success reached "
    "found_plan finished is_sat",
    "outcome.status": "status state result code outcome_status planning_status exit_code result_status",
    "outcome.reason": "reason failure error message why_failed unsolvable why_unsolvable error_message "
    "unsolvable_reason diagnosis failure_reason explain_failure failed",
    "cost": "metric value price total_cost plan_cost quality score objective reward metric_value g_value total_reward",
    "outcome.bound": "bound lower_bound gap optimal proved_optimal optimality optimality_gap upper_bound best_bound "
    "optimal_cost best_cost",
    "seconds": "time duration runtime elapsed planning_time total_time solve_time search_time wall_time cpu_time "
    "timing elapsed_time metrics_time planning_seconds time_taken solver_time total_planning_time cpu",
    "json()": "to_json dict dumps serialize serialise data raw asdict model_dump to_yaml",
    "save": "dump write to_file store export save_plan write_plan save_json to_path save_to save_as write_json "
    "persist pickle write_to_file export_plan",
    "plan.to_networkx()": "networkx to_graph nx digraph tree graph as_graph hierarchy dag causal_graph",
    "plan.to_dot()": "dot graphviz",
    "plan.to_dataframe()": "dataframe to_pandas df table pandas csv",
    "plan.to_records()": "records rows to_records list",
    "why": "why_step reasons justify explain_step because explain_action reason_for why_action justification causes "
    "explain_goal reason_of purpose why_step_is_needed",
    "why_not": "whynot contrast why_isnt counterfactual alternative instead why_not_action other_plans what_if "
    "second_best next_best other compare_with",
    "verify": "simulate check validate physics rollout verify_plan simulation validate_plan simulate_plan sim test "
    "check_plan monte_carlo evaluate valid run_simulation in_physics verified",
    "execute": "run act perform dispatch do play replay tick apply execute_plan run_plan start send execution "
    "perform_plan to_ros send_to_robot run_on_robot deploy ros publish send_goal",
    "report": "html page render plot view visualise visualize draw write_report open show_plan browse viewer "
    "plot_plan gantt picture save_report image dashboard write_html save_html to_png figure animate_plan "
    "timeline_html",
    "outcome.search": "statistics stats search expansions nodes metrics log_messages expanded generated evaluated "
    "nodes_expanded search_stats num_expanded log evaluations search_statistics",
    "verify().video": "animate video movie film record gif mp4 save_video",
    "timed": "schedule makespan timeline time_triggered_plan temporal timed_plan durations timed_actions start_times "
    "critical_path parallel concurrent partial_order_plan",
    "certificate": "proof certify unsolvability_proof unsat_core",
    "purposes": "causal_links links dependencies causal supports",
    "labels": "label labelled names words natural_language sentences captions verbalize in_words say narrate "
    "describe_steps in_english",
    "print(result), or report(FILE)": SHOW,
    "result.plan == other.plan (confab.history.compared compares stored runs)": COMPARE,
    "copy.deepcopy(result)": COPY,
    "scene.plan()": "replan plan_again repair again redo resolve next",
    "scene.read_result(FILE)": "load from_file read from_json parse load_plan read_plan from_dict load_result "
    "read_result",
    "scene.to_pddl()": "pddl",
    "confab export SCENE --bt (in a shell)": "behavior_tree bt behaviortree export_bt btcpp py_trees xml",
    "confab.Memory.of(scene).learn(scene, result)": "learn remember memory teach train add_to_memory",
    "outcome.engine": "planner_name engine planner engine_name solver",
    "outcome.forgone": "forgone soft_goals unmet violated preferences unmet_goals unsatisfied",
    "problem.initial": "initial_state initial facts init state_before start_state",
    "faults(PLAN)": "errors problems violations check_faults is_valid_plan check_plan_for",
    "execute().episode.observed": "final_state end_state state_after goal_state_reached",
    "execute().episode.course": "states trajectory state_trajectory state_sequence state_history",
    "plan.walk()": "walk_steps walk all_steps iterate traverse",
    "goals": "goals_met goal goal_facts tasks",
    "dearer()": "warning hints suggestions cheaper is_cheapest",
}
PLAN = {
    "result.outcome.bound": "optimal proved_optimal proven lower_bound",
    "steps": "behaviors behaviours plan subplans actions action_list sequence get_steps children nodes items values "
    "step action_names top_level list root",
    "primitives": "leaves low_level atoms primitive_actions flat flatten lowest leaf_steps commands motions atomic "
    "ground_actions linear bottom",
    "at_level(LEVEL)": "level by_level steps_at layer steps_at_level",
    "length": "size n_steps count_steps depth num_steps number_of_steps len height plan_length num_actions "
    "total_steps shape n_levels num_levels levels_count step_count",
    "walk()": "iter traverse all_steps visit descendants dfs preorder iterate all_actions flatten_all recursive "
    "every_step iter_steps",
    "to_networkx()": "graph networkx nx digraph tree  dag hierarchy",
    "to_dot()": "dot graphviz draw plot render pydot png visualize visualise figure image",
    "to_dataframe()": "to_csv csv dataframe df to_pandas table pandas",
    "json()": "to_json to_dict dict dumps serialize data to_yaml asdict jsonable",
    "to_records()": "records rows to_dicts ",
    "index(STEP)": "find position locate index_of find_step get",
    "scene.verify(plan)": "verify simulate check validate physics rollout valid simulation test check_plan "
    "is_applicable evaluate validate_plan",
    "scene.execute(plan)": "done progress current_step execute run act perform dispatch do play replay apply tick "
    "start execute_plan run_plan send next simulate_steps",
    "result.save(FILE)": "save write dump to_file store export save_json to_path write_plan save_plan persist "
    "write_to_file",
    "scene.read_plan(FILE)": "load from_file open read from_json parse load_plan from_dict read_plan",
    "scene.read_result(plan).report(FILE)": "report html show_page page view browse gantt",
    "scene.read_result(plan).why(STEP)": "why explain justify because explanation explain_step reason",
    "scene.read_result(plan).why_not(WHAT)": "why_not whynot contrast alternative",
    "result.cost": "cost total_cost metric price quality plan_cost value cost_per_step step_cost",
    "result.solved": "solved success found ok status",
    "result.timed": "schedule makespan timed duration timeline timed_actions start_times times total_time temporal "
    "parallel partial_order end_times",
    "result.purposes": "causal_links dependencies links causal ordering constraints adjacency_list",
    "result.in_order(ID, …)": "reorder order sort permute swap shuffle reordered",
    "result.goals": "goal task",
    "result.labels": "label words in_words natural_language sentences verbalize",
    "result.problem": "problem domain environment",
    "scene.plan(GOALS) (plans aren't edited)": "concatenate append insert remove add pop replace extend delete edit "
    "replace_action add_step replan repair substitute update set_step change refine splice clear remove_step concat "
    "merge join plus add_action map push unshift",
    "print(plan)": SHOW,
    "plan == other (confab.history.compared compares stored runs)": COMPARE,
    "copy.deepcopy(plan)": COPY,
    "confab export SCENE --bt (in a shell)": "behavior_tree bt behaviortree btcpp py_trees xml",
    "scene.to_pddl()": "pddl",
    "confab.Memory.of(scene).learn(scene, plan)": "learn remember memory teach train",
    "plan[-1]": "last tail end final last_step",
    "plan[0]": "first head first_step root_step",
    "plan[NUMBER]": "at nth item get_step step_at step_number getitem",
    "[step for step in plan.walk() if …]": "filter where select find_all search steps_of query",
    "result.execute().episode.observed": "final_state end_state state_after resulting_state outcome_state",
    "result.execute().episode.course": "states trajectory state_sequence",
    "scene.facts": "initial_state initial start_state init",
    "step in plan": "contains has includes is_in has_step",
}
STEP = {
    "behavior": "name action operator action_name behaviour schema skill action_type verb type behavior_name kind "
    "what function_name",
    "arguments": "items args parameters params actual_parameters operands args_list object target inputs param_values "
    "argument_names agent location robot hand subject values grounded ground_arguments objects_involved",
    "steps": "children substeps sub_steps refinement actions subplan decomposition sub_plan subtasks expand "
    "sub_actions primitive leaf body tasks",
    "bindings": "variables binding substitution assignment env free_variables variable_values",
    "walk()": "iter traverse descendants dfs all_steps preorder leaves primitives iterate",
    "path": "position address index_path location_in_tree ancestors coordinates order tree_path",
    "id": "number index key identifier uid uuid iri step_id action_id ident",
    "level": "depth layer height abstraction abstraction_level level_number tier",
    "rank": "score cogency weight priority probability",
    "scene.behaviors[step.behavior].preconditions": "precondition condition requires pre requirements applicable "
    "guard precond add_list needs",
    "scene.behaviors[step.behavior].effects": "effect adds deletes changes post del_effects outcomes achieves result "
    "postcondition add_effect changed_facts consequences expected expected_effects delta_state",
    "scene.behaviors[step.behavior].cost": "cost price metric reward action_cost",
    "result.why(step)": "why explain justify because purpose explanation reason goal causal_links motivation "
    "rationale depends_on enables needed_by supports needs_steps dependencies predecessors_of causes used_by "
    "expected_by",
    "result.why_not(WHAT)": "why_not whynot contrast alternative instead other_options",
    "result.timed": "duration start end start_time end_time time seconds makespan begin schedule finish interval t0",
    "result.labels.step(step)": "label words sentence title caption natural_language verbalize pretty_name "
    "display_name human_readable",
    "scene.verify(plan)": "outcome_of verify simulate check validate success status ok verdict succeeded failed valid",
    "scene.execute(plan)": "execute run perform apply do act call dispatch tick play send successor done execute_step "
    "completed started",
    "print(step)": SHOW,
    "json()": "to_json dict asdict serialize data to_record ",
    "step == other": COMPARE,
    "copy.deepcopy(step)": COPY,
    "plan.index(step)": "next previous next_step prev previous_step successors predecessors before after sibling",
    "result.problem": "world state domain",
    "result.plan[step.path[:-1]]": "parent up owner container",
}
EXECUTION = {
    "reached": "success succeeded ok solved done finished goal_reached complete verified result terminated is_success "
    "achieved passed truncated",
    "plan": "items steps actions executed done_plan trace executed_steps performed path action_history executed_plan "
    "primitives final_plan new_plan current_plan last_plan",
    "episode": "history log trajectory record steps_taken rollout transcript",
    "episode.events": "events observations states observed seen messages event_log obs timeline state_history feedback",
    "episode.replans": "replans repairs changes replanning num_replans replan_count recoveries number_of_replans "
    "plan_changes",
    "episode.failures": "faults failed problems exceptions failed_steps failed_actions failure error",
    "episode.interventions": "interventions disturbances perturbations surprises changes_of_the_world interrupts "
    "was_interrupted",
    "episode.status": "status outcome reason return_code final_status",
    "json()": "to_json dict dumps serialize serialise data asdict",
    "report": "html show page render plot view visualise visualize video display draw replay write_report film "
    "animate save_video dashboard movie picture",
    "save": "dump write to_file store export persist save_json save_as write_ttl to_ttl save_episode",
    "summary()": "describe explain message text info stats statistics print pretty metrics string str",
    "scene.read_episode(FILE)": "load from_file open read from_json parse",
    "episode.observed": "pose position location state final_state end_state last_state state_after current_state "
    "final_facts facts final "
    "robot_state state_of final_observations",
    "graph()": "networkx to_graph nx tree dot digraph",
    "scene.execute()": "resume continue_ restart run step again rerun execute repeat reset retry",
    "memory.learn(scene, execution)": "learn remember train memory teach",
    "copy.deepcopy(execution)": COPY,
    "episode.seconds": "seconds time duration elapsed runtime total_time wall_time",
    "result.cost": "cost reward total_reward total_cost score return_ returns",
    "plan.length": "length num_steps n_steps size len count",
    "scene.execute(world=WORLD)": "world env environment backend robot simulate step_simulation simulation",
    "violations": "constraints violated broken_constraints violated_constraints",
    "episode.reasons": "failure_reason why_failed error_message why",
    "confab export SCENE --trajectory FILE (in a shell)": "joint_states joint_state joints joint_positions "
    "joint_trajectory motions",
}
REPORT = {
    "verified": "success succeeded ok passed valid result reached solved status good_plan is_verified outcome verdict "
    "correct feasible is_success",
    "rollouts": "items runs trials simulations episodes verdicts results samples all_rollouts each attempts",
    "shown.failure": "failure error first_failure failed why reason fault failed_step failed_rollouts cause explain "
    "failing why_failed",
    "rate()": "success_rate accuracy score probability reliability percentage mean pass_rate confidence average "
    "success_probability",
    "good": "successes n_success count num_success n_successes n_passed succeeded_count passed_count "
    "number_of_successes",
    "trusted": "assumed unverified unchecked assumptions on_trust",
    "json()": "to_json dict serialize serialise data save write to_file dump asdict store",
    "table()": "dataframe steps details df rows csv records to_records to_pandas per_step measurements step_results "
    "measured",
    "video": "film movie mp4 save_video gif frames record animate render watch video_path clip videos",
    "summary()": "describe message text print info stats statistics pretty string str",
    "rollouts[0].cpu_seconds": "time duration elapsed runtime cpu_time total_time seconds",
    "result.report(FILE)": "html report page show view visualise visualize plot display write_report browse",
    "scene.read_report(FILE, PLAN)": "load read open from_file from_json parse",
    "scene.verify(plan)": "rerun again verify repeat run simulate validate rollout check",
    "poured": "amount poured_amount filled spill volume",
    "copy.deepcopy(report)": COPY,
}
MEMORY = {
    "confab.Memory.load(FILE)": "open read from_file parse restore from_ttl loads from_path",
    "confab.Memory.of(SCENE)": "new create empty for_scene from_scene init blank make",
    "save(FILE)": "state_dict write dump store to_file export persist save_to serialize to_ttl to_turtle commit write_ttl to_rdf",
    "learn(RESULT)": "add train update fit record remember append observe add_episode add_plan store_plan insert "
    "learn_from add_experience partial_fit learn_episode reinforce add_example put experience_replay step backward "
    "push",
    "teach(RESULT)": "demonstrate show_plan imitate demonstration add_demonstration from_demonstration "
    "learn_from_demonstration",
    "live": "add_execution learn_execution online learn_online",
    "merge(OTHER)": "combine join union extend add_memory update_from plus merge_with concat share sync",
    "table()": "stats statistics dataframe show links_table entries episodes rows list print to_pandas df items all "
    "size len length num_episodes n_episodes records num_rules summary describe info data count to_dict json "
    "probability probabilities likelihood confidence cogency is_empty scenes links_of print_table",
    "advice()": "rules advise suggest suggestions recommend preferences weights learned what_learned insights "
    "get_params get_parameters coef_ params predict policy best model get_rules parameters coefficients",
    "confab.Memory.of(SCENE) (a new memory)": "clear reset forget wipe delete erase remove empty_out unlearn drop "
    "prune forget_all",
    "scene.explain(memory=memory)": "explain why",
    "scene.plan(memory=memory)": "plan solve use apply query search guide rank",
    "page()": "html report visualise visualize plot draw view display dashboard",
    "copy.deepcopy(memory)": COPY,
    "confab.practise(scene, memory)": "score evaluate benchmark cross_val_score learning_curve test performance",
    "table().csv()": "export_csv csv save_csv",
    "trust(REPLICAS)": "trusted",
}
TABLE = {
    "dataframe()": "to_dataframe df to_pandas pandas frame as_dataframe to_numpy sort filter sort_values groupby "
    "pivot plot to_excel",
    "csv()": "to_csv save write to_file export dump",
    "records()": "to_dicts to_records json to_list dict data bindings asdict",
    "[*table]": "rows list fetchall results all items tolist head fetch tail first values_list fetchone itertuples "
    "iterrows sample one scalar single",
    "len(table)": "length size count num_rows row_count n_rows shape nrows",
    "columns": "vars variables header keys names fields column_names column num_columns n_columns",
    "truth": "askAnswer ask answer boolean bool yes",
    "print(table)": SHOW,
    "copy.deepcopy(table)": COPY,
    "dataframe().to_html()": "html",
}
PROBLEM = {
    "domain.behaviors": "operators behaviors behaviours action schemas action_schemas skills",
    "domain.situations": "predicates situations situation_types fluent properties state_variables",
    "initial": "fluent_values init initial_state initial_values state explicit_initial_values facts initial_facts "
    "start start_state",
    "goal": "goals goal_state target objective tasks goal_facts goal_condition",
    "individuals": "items objects all_objects instances constants user_objects things",
    "classes": "types user_types sorts kinds hierarchy",
    "scene": "name iri title label uri",
    "relations": "static_predicates static static_facts",
}
DOMAIN = {
    "behaviors": "operators behaviours action schemas action_schemas skills behavior methods",
    "situations": "predicates situation_types fluent properties types state_variables",
    "rules": "axioms derived derived_predicates",
    "constraints": "invariants",
}
BEHAVIOR = {
    "preconditions": "precondition pre requires condition requirements when precond guard needs",
    "effects": "post_conditions effect add_effects del_effects changes deletes post add del_ outcomes results "
    "postcondition add_list delete_list",
    "parameters": "args arguments params signature inputs parameter objects",
    "variables": "bindings free_variables determined",
    "cost": "price metric weight reward",
    "level": "layer depth abstraction",
    "timing": "duration time",
    "name": "label iri id title",
    "scene.affordances()": "ground instances groundings applicable possible",
    "scene.quantifying_query(NAME)": "query sparql",
}
SITUATION = {
    "arguments": "args parameters params signature domain arity subjects objects",
    "range": "values type codomain kind value_type options domain_of_values",
    "name": "label iri id title",
    "properties": "property predicate",
    "rest": "rest_value",
    "default": "default_value initial",
}
SYMBOL = {
    "situation": "predicate property name type fluent kind functor situation_type relation p",
    "arguments": "args parameters params subject terms object s",
    "scene.facts": "value initial o",
}
FACT = {
    "symbol": "fluent key variable atom lhs",
    "symbol.situation": "predicate property name type situation fluent_name relation p",
    "symbol.arguments": "args arguments parameters params objects subject terms s",
    "value": "object values rhs o target",
    "str(fact)": SHOW,
}
OUTCOME = {
    "search": "statistics stats expansions nodes metrics log_messages expanded generated evaluated nodes_expanded",
    "status": "solved success result success_code found ok",
    "reason": "error message why explanation failure",
    "seconds": "time duration elapsed runtime planning_time search_time",
    "plan": "steps solution actions",
}
EPISODE = {
    "done": "steps actions executed plan executed_steps performed trace",
    "planned": "original_plan first_plan initial_plan",
    "events": "items log history observations records timeline",
    "course": "trajectory states state_history",
    "observed": "final_state state end_state final last_state",
    "initial": "initial_state start_state init",
    "status": "success succeeded reached result solved done_status outcome",
    "reasons": "reason error why message",
    "seconds": "time duration elapsed runtime",
    "execution.save(FILE)": "save write dump to_file json",
    "len(episode.events)": "length size count n_steps",
    "scene.execute()": "run execute replay resume",
}
ROLLOUT = {
    "ok": "success succeeded verified passed valid status result",
    "steps": "reports verdicts results primitives actions",
    "failure": "error failed first_failure reason why fault",
    "cpu_seconds": "time duration elapsed seconds runtime",
    "state": "final_state observed facts end_state",
    "as_json()": "json to_dict",
}
VERDICT = {
    "ok": "success succeeded verified passed valid status result",
    "code": "failure_code error error_code kind failure",
    "message": "reason why text explanation description",
    "measured": "measurements numbers values metrics",
    "as_json()": "json to_dict",
}
SCHEDULE = {
    "makespan": "duration length total_time end cost total_duration",
    "slots": "steps actions timed_actions entries items intervals bars",
    "bound": "lower_bound optimal",
}
HINTS: Mapping[str, Mapping[str, str]] = {
    "confab": MODULE,
    "scene": SCENE,
    "result": RESULT,
    "plan": PLAN,
    "step": STEP,
    "execution": EXECUTION,
    "report": REPORT,
    "memory": MEMORY,
    "table": TABLE,
    "problem": PROBLEM,
    "domain": DOMAIN,
    "behaviour": BEHAVIOR,
    "situation": SITUATION,
    "symbol": SYMBOL,
    "fact": FACT,
    "outcome": OUTCOME,
    "episode": EPISODE,
    "rollout": ROLLOUT,
    "verdict": VERDICT,
    "schedule": SCHEDULE,
}
"""The tables of wrong names, by kind of object."""
COMMANDS = {
    "plan": "solve search find compute think astar replan goal planner make-plan get-plan find-plan find-solution "
    "compute-plan run-planner",
    "plan --diff OLD_SCENE": "diff plan-diff changes delta what-changed",
    "run": "demo all main pipeline start quickstart example tutorial hello main-job everything launch go bringup",
    "verify": "simulate simulation sim physics rollout check-plan validate-plan test-plan verify-plan rollouts "
    "evaluate eval val test",
    "execute": "act do run-plan execute-plan play perform dispatch exec loop control monitor tick replay execute-bt "
    "send drive resume repair step move react closed-loop recover",
    "explain": "why why-not whynot reason reasons justify explain-plan because diagnose contrast goals-why why-plan",
    "learn": "train fit teach practise practice learn-from demonstrate demo-learn imitate training",
    "memory": "experience mem rules memories forget knowledge",
    "report": "html page visualize visualise show view render write-report plot display present gantt report-plan "
    "print show-plan visualise-plan visualize-plan view-plan plan-report view-scene",
    "runs": "history compare log logs experiments results list-runs past show-runs compare-runs diff-runs mlflow "
    "track previous",
    "query": "ask sparql select search-graph find-facts facts triples rdf q state get arq objects goals list-objects "
    "list-facts list-goals individuals show-facts locations where",
    "query SCENE --affords all": "affordances applicable affords legal-actions actions possible",
    "query SCENE --show BEHAVIOR": "behaviors behaviours operators skills show-query",
    "serve": "server web ui gui app endpoint start-server dashboard live host http watch browser board open webui "
    "edit interactive rviz viewer api http-server up notebook daemon studio",
    "mcp": "agent agents llm mcp-server tools chat assistant claude",
    "picture": "draw image map diagram png svg screenshot graph picture-of visual dot graphviz classes ontology-graph "
    "figure hierarchy visual-graph tree",
    "validate": "check lint shacl consistency reasoner doctor check-scene validate-file consistent infer errors "
    "verify-file format fmt hermit test-scene",
    "new": "init create scaffold startproject template begin create-domain new-domain make start-project bootstrap "
    "add new-scene create-scene setup skeleton new-project create-ontology new-ontology start-domain "
    "create-scene-file make-domain",
    "generate": "gen random make-scene synth generate-scene sample bench benchmark build families generate-scenes "
    "random-scene",
    "convert": "transform translate to-sparql rewrite convert-behaviors",
    "fetch": "download get-ontology pull install clone-ontology wget add-import update imports",
    "import": "read-pddl from-pddl load import-pddl pddl2owl pddl-import parse load-pddl load-world upload",
    "export": "to-pddl pddl write-pddl save export-pddl trajectory dump write",
    "scenes": "list ls list-scenes examples info describe inspect catalog show-scenes domains available datasets "
    "problems inventory status objects-of stat levels worlds envs samples about",
    "--help": "help usage man manual commands docs ?",
    "--version": "version ver",
    "--completion SHELL": "completion completions install-completion",
    "plan --optimal": "optimize optimise optimal shortest cheapest best",
    "verify --video OUT.mp4": "film video record movie animate animation record-video gif",
    "plan --minimise makespan": "schedule makespan timeline parallel temporal",
    "export --bt": "bt behavior-tree behaviortree bt-export to-bt behaviour-tree",
    "execute --intervene": "interrupt disturb intervene perturb inject",
    "execute --on INTERFACE:ADDRESS": "robot robots connect ros ros2 hardware real",
    "plan --memory FILE": "use-memory plan-with-memory",
    "python -c 'import confab'": "shell repl console ipython python interactive-shell",
}
"""The names of the commands, each with other words for it."""
OPTIONS = {
    "time_limit seconds": "max_expansions max_nodes node_limit expansion_limit max_evaluations max_iterations timeout "
    "max_time deadline limit time max_seconds time_out budget t duration max_planning_time overall_time_limit "
    "search_time_limit max_runtime wall_time seconds sec timelimit",
    "rollouts": "trials runs n episodes repeat num_rollouts iterations times samples n_rollouts num_episodes "
    "repetitions repeats n_episodes tries attempts n_trials k num_trials",
    "rounds": "epochs iterations episodes repeat n_rounds n passes repeats",
    "seed": "random_seed rng random_state s seeds",
    "format": "fmt output_format csv results type as tsv f",
    "json": "format fmt json_output as_json output_format machine to_json print_json structured jsonl pretty indent "
    "text stdout",
    "output path folder": "html save_plan out outfile output_file out_dir save write dest to output_dir directory "
    "destination out_file file target result_file plan_file save_to dir sas_plan output_folder o outdir output_path "
    "filename file_name",
    "report": "html page visualize visualise web show_html view render plot html_report show open pretty browser",
    "video": "film movie record record_video mp4 save_video video_file animation gif capture",
    "gui watch": "render viewer window show display visualise visualize human headless gui_on interactive use_gui "
    "render_mode",
    "goals goal": "target task objective goal_state set_goal targets new_goal want desired goal_facts tasks to_achieve",
    "memory": "experience knowledge model learned mem use_memory memory_file with_memory checkpoint weights "
    "learned_from use",
    "no_memory": "without_memory no_learning fresh memoryless",
    "mode engine": "planner",
    "engine": "solver backend heuristic search_engine up_engine planner_name fast_downward external algorithm search "
    "use",
    "mode": "strategy algorithm alias method search_mode policy config variant heuristic search",
    "optimal minimise": "optimise optimize best shortest cost_optimal anytime optimality minimum_cost cheapest "
    "optimality_guarantee is_optimal find_optimal",
    "minimise": "minimize metric quality_metric criterion cost makespan minimise_cost quality objective",
    "interventions intervene": "intervention disturb disturbance event interrupt disturbances inject events change "
    "surprise perturbation",
    "world": "sim simulator simulation env environment real physics backend pybullet use_physics simulate in_world",
    "on": "robot connect interface hardware ros host address adapter driver",
    "serve": "port web live http web_port",
    "port": "p http_port address bind listen server_port host",
    "workers": "jobs j threads processes parallel n_jobs cores cpus num_workers nproc num_threads n_workers procs "
    "concurrency",
    "noise": "sigma std stddev noise_level sensor_noise error perception_noise",
    "perturb": "randomise randomize domain_randomization vary jitter perturbation random perturbations disturb robust",
    "verbose": "debug log log_level loglevel trace verbosity logging info vv",
    "quiet": "silent no_output no_log no_progress",
    "not": "why_not instead alternative whynot but contrast",
    "observed from_observed": "init initial state start from_state initial_state observation from start_state "
    "current_state observations",
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
    "from_observed": "initial_state input start",
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
    "the same call gives the same result in every process": "seed random_seed random_state rng set_seed",
    "the option -v of a command prints the duration of each stage": "verbose verbosity debug log_level loglevel log "
    "show_progress progress_bar",
}
"""Reasons why some functions and commands don't have a parameter, each with names for such a parameter."""
