"""A racing simulator in the likeness of DeepRacer: one car, one camera, any number of copies."""
