"""`affordant learn`: learners by name, held to the oracle while they learn, broken off and resumed."""
