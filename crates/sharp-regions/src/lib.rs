//! Critical regions: labels, network, prediction.
