; The sorting task of docs/method.md 1.1 and 1.2 for classical planners.
;
; Identical objects are counted, not named. A move is two actions (take, put), which kept problems
; of ten objects smallest among the encodings tried. Clutter slots are omitted: there are as many
; as objects, so that one is always free. Failed picks change nothing and are omitted as well;
; plans do not consider risk. Levels serve as numbers; ``number`` is a word of PDDL.
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
