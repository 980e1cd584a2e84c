#pragma once

#include <google/protobuf/message.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "clients/cpp/channel.h"

namespace pepeseg::client::cli {

// What the command line said: the options that every verb shares, and the verb that was chosen.
struct Shell {
  std::string program = "pepeseg";  // as it was called
  std::string server = "127.0.0.1:50051";
  Login login;
  std::shared_ptr<grpc::Channel> channel;  // to `server`; there when the verb runs
  bool json = false;  // standard output is for a program: JSON only; progress keeps to stderr
  std::function<absl::Status()> verb;
};

// One line of JSON with the contract's own field names; empty fields are written too.
std::string ToJson(const google::protobuf::Message& message);

// To standard output, with a line end.
void Print(const std::string& line);
void PrintJson(const google::protobuf::Message& message);
// To standard error, whatever --json says.
void Note(const std::string& line);

// Every verb's file has one of these: adds the verb and its options; parsing sets shell.verb.
void AddUpload(CLI::App& app, Shell& shell);
void AddEstimate(CLI::App& app, Shell& shell);
void AddTrain(CLI::App& app, Shell& shell);
void AddWatch(CLI::App& app, Shell& shell);
void AddCancel(CLI::App& app, Shell& shell);
void AddJobs(CLI::App& app, Shell& shell);
void AddScenes(CLI::App& app, Shell& shell);
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
void AddCompletion(CLI::App& app, Shell& shell);

}  // namespace pepeseg::client::cli
