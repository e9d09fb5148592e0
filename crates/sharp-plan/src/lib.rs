//! Algorithm 1: search, learning, composed policy, library.
