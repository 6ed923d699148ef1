# Asks the daemon at the first argument with the package that OpenAPI Generator has written, installed into the second.
arguments <- commandArgs(trailingOnly = TRUE)
library(openapi, lib.loc = arguments[[2]])

client <- ApiClient$new(base_path = arguments[[1]])
calibrations <- CalibrationsApi$new(client)
health <- HealthApi$new(client)$GetHealth()
listed <- calibrations$ListCalibrations()
ids <- sapply(listed$calibrations, function(each) each$id)
one <- calibrations$GetCalibration(ids[[1]])
answer <- list(
  status = jsonlite::unbox(health$status),
  listed = ids,
  translation_mm = unlist(one$flange_T_camera$translation_mm)
)
cat(jsonlite::toJSON(answer, digits = NA), "\n")
