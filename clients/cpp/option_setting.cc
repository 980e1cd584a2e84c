#include "clients/cpp/option_setting.h"

#include <google/protobuf/descriptor.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/nearest_names.h"

namespace pepeseg::client {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Appends "PREFIXNAME (TYPE)" for each field, depth first.
void AppendNames(const Descriptor& type, const std::string& prefix,
                 std::vector<std::string>& names) {
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    const std::string name = prefix + field.name();
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      AppendNames(*field.message_type(), name + ".", names);
    } else {
      names.push_back(absl::StrCat(name, " (", field.cpp_type_name(), ")"));
    }
  }
}

// Parses `text` and passes the value to `set`; returns false if it is not a T.
template <typename T, typename Parse, typename Set>
bool ParseAndSet(absl::string_view text, Parse parse, Set set) {
  T value{};
  if (!parse(text, &value)) return false;
  set(value);
  return true;
}

// Sets an enum by the whole name of a value, or by the end of that name after a '_'. Returns false
// if there is no such value.
bool SetEnum(absl::string_view text, const FieldDescriptor& field, Message& message) {
  const std::string name = absl::AsciiStrToUpper(text);
  for (int i = 0; i < field.enum_type()->value_count(); ++i) {
    const auto& value = *field.enum_type()->value(i);
    if (value.name() != name && !absl::EndsWith(value.name(), "_" + name)) continue;
    message.GetReflection()->SetEnum(&message, &field, &value);
    return true;
  }
  return false;
}

// Sets `field` from text; returns false if the text is not a value of its type.
bool SetField(absl::string_view text, const FieldDescriptor& field, Message& message) {
  const auto& reflection = *message.GetReflection();
  const auto with = [&](auto setter) {
    return [&, setter](auto value) { (reflection.*setter)(&message, &field, value); };
  };
  using R = google::protobuf::Reflection;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return ParseAndSet<int32_t>(text, absl::SimpleAtoi<int32_t>, with(&R::SetInt32));
    case FieldDescriptor::CPPTYPE_INT64:
      return ParseAndSet<int64_t>(text, absl::SimpleAtoi<int64_t>, with(&R::SetInt64));
    case FieldDescriptor::CPPTYPE_UINT64:
      return ParseAndSet<uint64_t>(text, absl::SimpleAtoi<uint64_t>, with(&R::SetUInt64));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return ParseAndSet<float>(text, absl::SimpleAtof, with(&R::SetFloat));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return ParseAndSet<double>(text, absl::SimpleAtod, with(&R::SetDouble));
    case FieldDescriptor::CPPTYPE_BOOL:
      return ParseAndSet<bool>(text, absl::SimpleAtob, with(&R::SetBool));
    case FieldDescriptor::CPPTYPE_ENUM:
      return SetEnum(text, field, message);
    case FieldDescriptor::CPPTYPE_STRING:  // lists of text are the only text in the options
      if (!field.is_repeated() || text.empty()) return false;
      reflection.AddString(&message, &field, std::string(text));
      return true;
    default:
      return false;  // no option of the contract has another type
  }
}

// Returns the field that a name such as "reconstruct.num_steps" leads to; null if there is none or
// it is a message.
const FieldDescriptor* FindField(absl::string_view name, const Descriptor& type) {
  const Descriptor* within = &type;
  const FieldDescriptor* field = nullptr;
  for (const absl::string_view part : absl::StrSplit(name, '.')) {
    if (within == nullptr) return nullptr;
    field = within->FindFieldByName(std::string(part));
    if (field == nullptr) return nullptr;
    within = field->message_type();
  }
  return within == nullptr ? field : nullptr;
}

// Returns the values of an enum in lower case, without the prefix that all of them share.
std::vector<std::string> ShortNames(const google::protobuf::EnumDescriptor& type) {
  // Names of enum values share their type's name as a prefix, by the style of protobuf.
  std::string prefix = type.value(0)->name();
  for (int i = 1; i < type.value_count(); ++i) {
    while (!absl::StartsWith(type.value(i)->name(), prefix)) prefix.pop_back();
  }
  prefix.resize(prefix.rfind('_') + 1);
  std::vector<std::string> names;
  for (int i = 0; i < type.value_count(); ++i) {
    names.push_back(absl::AsciiStrToLower(type.value(i)->name().substr(prefix.size())));
  }
  return names;
}

// Returns "of type float", or "one of windows, patch".
std::string Expected(const FieldDescriptor& field) {
  if (field.enum_type() == nullptr) return absl::StrCat("of type ", field.cpp_type_name());
  return absl::StrCat("one of ", absl::StrJoin(ShortNames(*field.enum_type()), ", "));
}

// Returns the names of all options, without their types.
std::vector<std::string> PlainNames(const Descriptor& type, const std::string& prefix) {
  std::vector<std::string> names;
  AppendNames(type, prefix, names);
  for (std::string& name : names) name.resize(name.find(' '));
  return names;
}

}  // namespace

absl::Status SetOption(absl::string_view setting, Message& options) {
  const size_t equals = setting.find('=');
  if (equals == absl::string_view::npos) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--option ", setting, ": expected NAME=VALUE, such as reconstruct.num_steps=3000"));
  }
  const absl::string_view name = setting.substr(0, equals);
  const absl::string_view value = setting.substr(equals + 1);
  Message* message = &options;
  const FieldDescriptor* field = FindField(name, *options.GetDescriptor());
  for (const absl::string_view part : absl::StrSplit(name, '.')) {
    if (field == nullptr || field->containing_type() == message->GetDescriptor()) break;
    // Creates the messages on the way to the field, which makes them present in the request.
    message = message->GetReflection()->MutableMessage(
        message, message->GetDescriptor()->FindFieldByName(std::string(part)));
  }
  if (field == nullptr) {
    const std::string similar =
        DidYouMean(NearestNames(name, PlainNames(*options.GetDescriptor(), "")));
    return absl::InvalidArgumentError(
        absl::StrCat("unknown option \"", name, "\"", similar.empty() ? ";" : similar,
                     " `pepeseg train SCENE --list-options` lists all options"));
  }
  if (!SetField(value, *field, *message)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--option ", name, ": \"", value, "\" is not ", Expected(*field)));
  }
  return absl::OkStatus();
}

std::vector<std::string> OptionNames(const Message& options) {
  std::vector<std::string> names;
  AppendNames(*options.GetDescriptor(), "", names);
  return names;
}

std::vector<std::string> ValueNames(absl::string_view name, const Message& options) {
  const FieldDescriptor* field = FindField(name, *options.GetDescriptor());
  if (field == nullptr || field->enum_type() == nullptr) return {};
  return ShortNames(*field->enum_type());
}

}  // namespace pepeseg::client
