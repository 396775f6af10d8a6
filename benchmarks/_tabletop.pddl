; Served tables for flat planners: the actions that the export of `reasoner.pddl_export` has, without those that only matter once
; two hands hold one object, which no plan needs: only what is in a hand is put down, only what a hand grasped is lifted from
; its place. It saves a flat planner nine tenths of its operators and more. For problems that the export writes.
(define (domain generated)
  (:requirements :strips :typing)
  (:types
    location - object
    movable - object
    hand - object
    beverage - object
    bottle - movable
    cup - movable)
  (:constants
    no_beverage - object
    raised - object
    tilted - object
    upright - object
    nothing - object
    in_hand - object)
  (:predicates
    (beverage ?x0 ?x1)
    (canreach ?x0 ?x1)
    (different ?x0 ?x1)
    (hand_position ?x0 ?x1)
    (hand_tilt ?x0 ?x1)
    (holds ?x0 ?x1)
    (location ?x0 ?x1)
    (no_movable_has_location ?x0))
  (:action b3_reach_hand_object
    :parameters (?hand - hand ?object - movable ?place - location)
    :precondition (and
      (location ?object ?place)
      (hand_position ?hand raised)
      (canreach ?hand ?place))
    :effect (and
      (not (hand_position ?hand raised))
      (hand_position ?hand ?object)))
  (:action b3_reach_hand_location
    :parameters (?hand - hand ?location - location)
    :precondition (and
      (no_movable_has_location ?location)
      (hand_position ?hand raised)
      (canreach ?hand ?location))
    :effect (and
      (not (hand_position ?hand raised))
      (hand_position ?hand ?location)))
  (:action b3_grasp
    :parameters (?hand - hand ?object - movable)
    :precondition (and
      (hand_position ?hand ?object)
      (holds ?hand nothing))
    :effect (and
      (not (holds ?hand nothing))
      (holds ?hand ?object)))
  (:action b3_put_down
    :parameters (?hand - hand ?location - location ?object - movable)
    :precondition (and
      (hand_position ?hand ?location)
      (no_movable_has_location ?location)
      (holds ?hand ?object)
      (location ?object in_hand))
    :effect (and
      (not (location ?object in_hand))
      (not (no_movable_has_location ?location))
      (not (holds ?hand ?object))
      (location ?object ?location)
      (holds ?hand nothing)))
  (:action b3_lift
    :parameters (?hand - hand ?object - movable ?old - object)
    :precondition (and
      (hand_position ?hand ?object)
      (hand_tilt ?hand upright)
      (holds ?hand ?object)
      (location ?object ?old)
      (different ?old in_hand))
    :effect (and
      (not (location ?object ?old))
      (not (hand_position ?hand ?object))
      (location ?object in_hand)
      (no_movable_has_location ?old)
      (hand_position ?hand raised)))
  (:action b3_lift_
    :parameters (?hand - hand ?object - movable ?other - object)
    :precondition (and
      (hand_position ?hand ?other)
      (different ?other raised)
      (hand_tilt ?hand upright)
      (holds ?hand ?object)
      (location ?object in_hand))
    :effect (and
      (not (hand_position ?hand ?other))
      (hand_position ?hand raised)))
  (:action b3_lift__
    :parameters (?hand - hand ?other - object)
    :precondition (and
      (hand_position ?hand ?other)
      (different ?other raised)
      (hand_tilt ?hand upright)
      (holds ?hand nothing))
    :effect (and
      (not (hand_position ?hand ?other))
      (hand_position ?hand raised)))
  (:action b3_tilt
    :parameters (?hand - hand ?drink - beverage ?source - bottle ?target - cup)
    :precondition (and
      (hand_position ?hand ?target)
      (holds ?hand ?source)
      (beverage ?source ?drink)
      (beverage ?target no_beverage)
      (hand_tilt ?hand upright))
    :effect (and
      (not (beverage ?target no_beverage))
      (not (hand_tilt ?hand upright))
      (beverage ?target ?drink)
      (hand_tilt ?hand tilted)))
  (:action b3_stand_upright
    :parameters (?hand - hand)
    :precondition (and
      (hand_tilt ?hand tilted))
    :effect (and
      (not (hand_tilt ?hand tilted))
      (hand_tilt ?hand upright))))
