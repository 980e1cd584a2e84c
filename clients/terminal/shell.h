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
  std::string program = "pepeseg";  // name or path of `pepeseg`, for commands that are proposed
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

}  // namespace pepeseg::client::cli
