"""One pure function and one frozen result each: arrays and models in, a result out."""
