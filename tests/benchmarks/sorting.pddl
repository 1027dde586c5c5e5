; The sorting task of docs/method.md 1.1 and 1.2 for classical planners.
;
; Twins are counted, not named, and a move is a take and a put, which kept problems of ten objects
; smallest of the ways tried. Which clutter cell an object lies in is left out: there are as
; many cells as objects, so a free one never lacks, and only the risk of a pick depends on it.
; Failed picks are left out as well: they change nothing, so the action is tried again; a plan
; knows of no risk, and no twin is better than the other.
; Levels serve as numbers as well; ``number`` itself is a word of PDDL.
(define (domain sorting)
  (:requirements :strips :typing)
  (:types tower level code)
  (:predicates
    (free-hand)
    (held ?c - code)
    (spare ?c - code ?n - level)
    (height ?t - tower ?n - level)
    (shows ?t - tower ?at - level ?c - code)
    (next ?n - level ?more - level))

  (:action take-from-clutter
    :parameters (?c - code ?n - level ?more - level)
    :precondition (and (free-hand) (spare ?c ?more) (next ?n ?more))
    :effect (and (held ?c) (spare ?c ?n) (not (free-hand)) (not (spare ?c ?more))))

  (:action put-in-clutter
    :parameters (?c - code ?n - level ?more - level)
    :precondition (and (held ?c) (spare ?c ?n) (next ?n ?more))
    :effect (and (free-hand) (spare ?c ?more) (not (held ?c)) (not (spare ?c ?n))))

  (:action take-from-tower
    :parameters (?c - code ?t - tower ?n - level ?more - level)
    :precondition (and (free-hand) (height ?t ?more) (next ?n ?more) (shows ?t ?n ?c))
    :effect (and (held ?c) (height ?t ?n) (not (free-hand)) (not (height ?t ?more))
      (not (shows ?t ?n ?c))))

  (:action put-on-tower
    :parameters (?c - code ?t - tower ?n - level ?more - level)
    :precondition (and (held ?c) (height ?t ?n) (next ?n ?more))
    :effect (and (free-hand) (height ?t ?more) (shows ?t ?n ?c) (not (held ?c))
      (not (height ?t ?n)))))
