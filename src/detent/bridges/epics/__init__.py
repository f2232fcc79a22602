"""EPICS motor records over host drivers: `record` is what a motor record does, `ioc` serves it by Channel Access."""
