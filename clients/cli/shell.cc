#include "clients/cli/shell.h"

#include <google/protobuf/util/json_util.h>

#include <cstdio>

namespace pepeseg::client::cli {

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  return status.ok() ? json : "{}";
}

void Print(const std::string& line) {
  std::fputs((line + "\n").c_str(), stdout);
  std::fflush(stdout);
}

void PrintJson(const google::protobuf::Message& message) { Print(ToJson(message)); }

void Note(const std::string& line) { std::fputs((line + "\n").c_str(), stderr); }

}  // namespace pepeseg::client::cli
