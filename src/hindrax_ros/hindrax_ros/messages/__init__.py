"""Messages: conversion from and to values of the core, serialization, and the frames that they name."""
