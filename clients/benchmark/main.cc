// pepeseg-benchmark: trains and scores scenes on a pepeseg server.
#include "clients/benchmark/verbs.h"
#include "clients/terminal/program.h"

namespace {

using namespace pepeseg::client::cli;

void AddVerbs(CLI::App& app, Shell& shell) {
  AddDemo(app, shell);
  AddEvaluate(app, shell);
  AddSuite(app, shell);
  AddCurves(app, shell);
}

}  // namespace

int main(int argc, char** argv) {
  return RunProgram(
      {"pepeseg-benchmark", "Scores of models, from one model to whole benchmarks", AddVerbs}, argc,
      argv);
}
