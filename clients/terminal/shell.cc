#include "clients/terminal/shell.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cstdio>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace pepeseg::client::cli {

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  // Scripts see the names of the contract, and every field in every answer.
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  return status.ok() ? json : "{}";
}

void Print(const std::string& line) {
  std::fputs((line + "\n").c_str(), stdout);
  // A script that reads a pipe gets each line at once.
  std::fflush(stdout);
}

void PrintJson(const google::protobuf::Message& message) { Print(ToJson(message)); }

void Note(const std::string& line) { std::fputs((line + "\n").c_str(), stderr); }

std::string Quoted(const std::string& word) {
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || std::string("_-./,:=@+%").find(c) != std::string::npos;
  });
  if (plain) return word;
  // Within single quotes only the quote itself is special: it is closed, escaped and opened again.
  return absl::StrCat("'", absl::StrReplaceAll(word, {{"'", "'\\''"}}), "'");
}

}  // namespace pepeseg::client::cli
