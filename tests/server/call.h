#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <concepts>
#include <memory>
#include <source_location>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/status/status.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/errors.pb.h"
#include "pepeseg/v1/edit_service.grpc.pb.h"
#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/render_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "tests/testing/status_testing.h"

// Unary calls of the contract, as tests make them, and what tests expect of errors.
namespace pepeseg {

using SceneStub = v1::SceneService::Stub;
using DatasetStub = v1::DatasetService::Stub;
using JobStub = v1::JobService::Stub;
using SegmentationStub = v1::SegmentationService::Stub;
using LabelStub = v1::LabelService::Stub;
using SelectionStub = v1::SelectionService::Stub;
using EditStub = v1::EditService::Stub;
using RenderStub = v1::RenderService::Stub;
using EvaluationStub = v1::EvaluationService::Stub;
using AdminStub = v1::AdminService::Stub;

template <class Stub, class Request, class Response>
using Method = grpc::Status (Stub::*)(grpc::ClientContext*, const Request&, Response*);

// The answer to a call, or its error. Reading the answer of a call that failed fails the test with
// the error and gives an empty message.
template <class Response>
class Reply {
 public:
  Reply(grpc::Status status, Response response, std::source_location where)
      : status_(std::move(status)), response_(std::move(response)), where_(where) {}

  bool ok() const { return status_.ok(); }
  const grpc::Status& status() const { return status_; }
  operator const grpc::Status&() const { return status_; }  // NOLINT(google-explicit-constructor)
  const Response& operator*() const& { return Checked(); }
  Response operator*() && { return Checked(); }
  Response value() && { return Checked(); }
  const Response* operator->() const { return &Checked(); }

 private:
  const Response& Checked() const {
    if (!ok()) {
      ADD_FAILURE_AT(where_.file_name(), static_cast<int>(where_.line()))
          << "the call failed: " << status_.error_message();
    }
    return response_;
  }

  grpc::Status status_;
  Response response_;
  std::source_location where_;
};

// Calls `method` over `channel`, with the metadata and the deadline of `context`.
template <class Stub, class Request, class Response>
Reply<Response> CallWith(grpc::ClientContext& context,
                         const std::shared_ptr<grpc::Channel>& channel,
                         Method<Stub, Request, Response> method,
                         const std::type_identity_t<Request>& request,
                         std::source_location where = std::source_location::current()) {
  Response response;
  grpc::Status status = (Stub(channel).*method)(&context, request, &response);
  return {std::move(status), std::move(response), where};
}
// Calls without metadata. A server that hangs fails the call after four minutes.
template <class Stub, class Request, class Response>
Reply<Response> CallOver(const std::shared_ptr<grpc::Channel>& channel,
                         Method<Stub, Request, Response> method,
                         const std::type_identity_t<Request>& request,
                         std::source_location where = std::source_location::current()) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(4));
  return CallWith(context, channel, method, request, where);
}

// Requests that have only a name, or only a parent.
struct Named {
  template <class Request>
  operator Request() const {  // NOLINT(google-explicit-constructor)
    Request request;
    request.set_name(name);
    return request;
  }
  std::string name;
};
struct Under {
  template <class Request>
  operator Request() const {  // NOLINT(google-explicit-constructor)
    Request request;
    request.set_parent(parent);
    return request;
  }
  std::string parent;
};

// Returns the error of a call with its details as fields. Fails the test if there is another
// detail, such as the mark of a private error.
v1::Error DetailOf(const grpc::Status& status);

// Expected details of an error. Empty: not compared.
struct ErrorParts {
  std::string field = {}, reason = {}, resource = {}, value = {}, limit = {};
  std::string message = {};  // a part of the message
};

// Compares the error of a call; EXPECT_ERROR reports the difference.
::testing::AssertionResult IsError(const grpc::Status& status, grpc::StatusCode code,
                                   const ErrorParts& parts = {});
// `field`: of the request, as "prompt.points[0].x"; `words`: a part of the message.
template <std::convertible_to<std::string> Field>
::testing::AssertionResult IsError(const grpc::Status& status, grpc::StatusCode code,
                                   const Field& field, const std::string& words = "") {
  return IsError(status, code, ErrorParts{.field = field, .message = words});
}

}  // namespace pepeseg

namespace pepeseg::testing {

// For EXPECT_OK and ASSERT_OK; also of a Reply.
inline absl::Status StatusOf(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

}  // namespace pepeseg::testing

// EXPECT_ERROR(call, code), EXPECT_ERROR(call, code, field), EXPECT_ERROR(call, code, field, words)
// or EXPECT_ERROR(call, code, {.reason = "NO_MODEL", .resource = name}): see IsError. `call` is a
// Reply or a grpc::Status.
#define EXPECT_ERROR(call, ...) EXPECT_TRUE(::pepeseg::IsError((call), __VA_ARGS__))
