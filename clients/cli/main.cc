// pepeseg: the command-line client of a pepeseg server.
#include "clients/cli/verbs.h"
#include "clients/terminal/program.h"

namespace {

using namespace pepeseg::client::cli;

void AddVerbs(CLI::App& app, Shell& shell) {
  AddScenes(app, shell);
  AddDatasets(app, shell);
  AddModels(app, shell);
  AddUpload(app, shell);
  AddEstimate(app, shell);
  AddTrain(app, shell);
  AddWatch(app, shell);
  AddCancel(app, shell);
  AddJobs(app, shell);
  AddSegment(app, shell);
  AddPropose(app, shell);
  AddCorrect(app, shell);
  AddRender(app, shell);
  AddPhotograph(app, shell);
  AddLabel(app, shell);
  AddLabels(app, shell);
  AddSelect(app, shell);
  AddSelections(app, shell);
  AddCombine(app, shell);
  AddEdit(app, shell);
  AddFind(app, shell);
  AddDecompose(app, shell);
  AddExport(app, shell);
  AddMesh(app, shell);
  AddResidents(app, shell);
  AddKeys(app, shell);
  AddQuota(app, shell);
  AddTop(app, shell);
  AddDrain(app, shell);
  AddHealth(app, shell);
  AddCompletion(app, shell);
}

}  // namespace

int main(int argc, char** argv) {
  return RunProgram({"pepeseg", "Scenes from photographs, segments from clicks", AddVerbs}, argc,
                    argv);
}
