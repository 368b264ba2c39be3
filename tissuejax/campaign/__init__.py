"""Campaigns: one question asked of many samples, on one machine or many, nothing done twice and nothing lost."""
