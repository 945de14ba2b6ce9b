"""The paper measured again: from runs in its scenes and others to a report that says which of its claims hold."""
