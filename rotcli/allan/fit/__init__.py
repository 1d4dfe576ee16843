"""Fit the noise terms of IEEE Std 952 to an Allan variance, and judge the fit."""
