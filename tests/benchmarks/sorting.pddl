; The sorting task of METHOD 1.1 and 1.2 for classical planners.
;
; A move is a take and a put, so that a planner need not ground every pair of places. Which
; clutter cell an object lies in is left out: there are as many cells as objects, so a free one
; never lacks, and only the risk of a pick depends on it. Failed picks are left out as well: they
; change nothing, so the next action of the plan is tried again; a plan knows no risk, and no
; twin is better than the other.
(define (domain sorting)
  (:requirements :strips :typing)
  (:types object-to-sort tower level code)
  (:predicates
    (free-hand)
    (held ?o - object-to-sort)
    (clutter ?o - object-to-sort)
    (on ?o - object-to-sort ?t - tower ?l - level)
    (shows ?t - tower ?l - level ?c - code)
    (height ?t - tower ?l - level)
    (next ?below - level ?above - level)
    (looks ?o - object-to-sort ?c - code))

  (:action take-from-clutter
    :parameters (?o - object-to-sort)
    :precondition (and (free-hand) (clutter ?o))
    :effect (and (held ?o) (not (free-hand)) (not (clutter ?o))))

  (:action put-in-clutter
    :parameters (?o - object-to-sort)
    :precondition (held ?o)
    :effect (and (clutter ?o) (free-hand) (not (held ?o))))

  (:action put-on-tower
    :parameters (?o - object-to-sort ?c - code ?t - tower ?l - level ?above - level)
    :precondition (and (held ?o) (looks ?o ?c) (height ?t ?l) (next ?l ?above))
    :effect (and (on ?o ?t ?l) (shows ?t ?l ?c) (height ?t ?above) (free-hand)
      (not (height ?t ?l)) (not (held ?o))))

  (:action take-from-tower
    :parameters (?o - object-to-sort ?c - code ?t - tower ?l - level ?above - level)
    :precondition (and (free-hand) (on ?o ?t ?l) (looks ?o ?c) (height ?t ?above)
      (next ?l ?above))
    :effect (and (held ?o) (height ?t ?l) (not (free-hand)) (not (on ?o ?t ?l))
      (not (shows ?t ?l ?c)) (not (height ?t ?above)))))
