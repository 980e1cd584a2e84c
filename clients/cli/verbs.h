#pragma once

#include <CLI/CLI.hpp>

#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {

// Each adds a verb with its options to the parser. Parsing a command line with that verb sets
// shell.verb. Both arguments must outlive the parser.
void AddUpload(CLI::App& app, Shell& shell);
void AddEstimate(CLI::App& app, Shell& shell);
void AddTrain(CLI::App& app, Shell& shell);
void AddWatch(CLI::App& app, Shell& shell);
void AddCancel(CLI::App& app, Shell& shell);
void AddJobs(CLI::App& app, Shell& shell);
void AddScenes(CLI::App& app, Shell& shell);
void AddDatasets(CLI::App& app, Shell& shell);
void AddModels(CLI::App& app, Shell& shell);
void AddSegment(CLI::App& app, Shell& shell);
void AddPropose(CLI::App& app, Shell& shell);
void AddFind(CLI::App& app, Shell& shell);
void AddCorrect(CLI::App& app, Shell& shell);
void AddRender(CLI::App& app, Shell& shell);
void AddPhotograph(CLI::App& app, Shell& shell);
void AddLabel(CLI::App& app, Shell& shell);
void AddLabels(CLI::App& app, Shell& shell);
void AddSelect(CLI::App& app, Shell& shell);
void AddSelections(CLI::App& app, Shell& shell);
void AddCombine(CLI::App& app, Shell& shell);
void AddEdit(CLI::App& app, Shell& shell);
void AddDecompose(CLI::App& app, Shell& shell);
void AddExport(CLI::App& app, Shell& shell);
void AddMesh(CLI::App& app, Shell& shell);
void AddResidents(CLI::App& app, Shell& shell);  // resident, load, unload, pin
void AddKeys(CLI::App& app, Shell& shell);       // key-create, key-list, key-revoke
void AddQuota(CLI::App& app, Shell& shell);
void AddTop(CLI::App& app, Shell& shell);
void AddDrain(CLI::App& app, Shell& shell);
void AddHealth(CLI::App& app, Shell& shell);
void AddCompletion(CLI::App& app, Shell& shell);

}  // namespace pepeseg::client::cli
