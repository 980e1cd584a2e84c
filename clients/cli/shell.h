#pragma once

#include <google/protobuf/message.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "clients/cpp/channel.h"

namespace pepeseg::client::cli {

// The parsed command line: the options that all verbs share, and the chosen verb.
struct Shell {
  std::string program = "pepeseg";  // name or path that the program was called by
  std::string server = "127.0.0.1:50051";
  Login login;
  std::shared_ptr<grpc::Channel> channel;  // to `server`; set before `verb` is called
  bool json = false;  // --json: standard output has JSON only, progress is on stderr
  std::function<absl::Status()> verb;  // runs the chosen verb
};

// Returns a message as one line of JSON with the field names of the contract, empty fields
// included.
std::string ToJson(const google::protobuf::Message& message);

// Prints a line to standard output.
void Print(const std::string& line);
// Prints ToJson(message) to standard output.
void PrintJson(const google::protobuf::Message& message);
// Prints a line to standard error, with and without --json.
void Note(const std::string& line);

// Returns `word` as a POSIX shell needs it, in single quotes unless it has plain characters only.
std::string Quoted(const std::string& word);

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
void AddRender(CLI::App& app, Shell& shell);
void AddPhotograph(CLI::App& app, Shell& shell);
void AddLabel(CLI::App& app, Shell& shell);
void AddLabels(CLI::App& app, Shell& shell);
void AddSelect(CLI::App& app, Shell& shell);
void AddSelections(CLI::App& app, Shell& shell);
void AddCombine(CLI::App& app, Shell& shell);
void AddDecompose(CLI::App& app, Shell& shell);
void AddEvaluate(CLI::App& app, Shell& shell);
void AddExport(CLI::App& app, Shell& shell);
void AddResidents(CLI::App& app, Shell& shell);  // resident, load, unload, pin
void AddKeys(CLI::App& app, Shell& shell);       // key-create, key-list, key-revoke
void AddQuota(CLI::App& app, Shell& shell);
void AddTop(CLI::App& app, Shell& shell);
void AddDrain(CLI::App& app, Shell& shell);
void AddHealth(CLI::App& app, Shell& shell);
void AddDemo(CLI::App& app, Shell& shell);
void AddBench(CLI::App& app, Shell& shell);
void AddBenchmark(CLI::App& app, Shell& shell);
void AddCompletion(CLI::App& app, Shell& shell);

}  // namespace pepeseg::client::cli
