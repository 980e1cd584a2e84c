// The details of the server's errors, for the app and the back end. On the wire they have the names of
// google.rpc, so that other tools decode them, and the fields of our messages: errors.proto.
import type { DescMessage, MessageInitShape, MessageShape } from '@bufbuild/protobuf';
import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import type { Code } from '@connectrpc/connect';
import { ConnectError } from '@connectrpc/connect';
import {
  BadRequestSchema,
  ErrorInfoSchema,
  ResourceInfoSchema,
  RetryInfoSchema,
} from '../gen/pepeseg/v1/errors_pb';

export interface ErrorDetail {
  /** For programs, such as "JOB_ACTIVE". */
  readonly reason: string;
  /** Path of the request's field; may be empty, as the texts below. */
  readonly field: string;
  /** Name of the resource that is missing or prevents the call. */
  readonly resource: string;
  readonly limit: string;
  readonly value: string;
  /** Time after which a repetition makes sense; undefined: waiting does not help. */
  readonly retryMs: number | undefined;
}

/** Domain of our server's ErrorInfo. */
const domain = 'pepeseg';

function typeOf(schema: DescMessage): string {
  return `google.rpc.${schema.name}`;
}

function find<Desc extends DescMessage>(
  { details }: ConnectError,
  schema: Desc,
): MessageShape<Desc> | undefined {
  for (const detail of details) {
    if ('type' in detail && detail.type === typeOf(schema)) return fromBinary(schema, detail.value);
  }
  return undefined;
}

function parse(error: ConnectError): ErrorDetail | undefined {
  const info = find(error, ErrorInfoSchema);
  if (info?.domain !== domain) return undefined;
  const delay = find(error, RetryInfoSchema)?.retryDelay;
  return {
    reason: info.reason,
    field: find(error, BadRequestSchema)?.fieldViolations[0]?.field ?? '',
    resource: find(error, ResourceInfoSchema)?.resourceName ?? '',
    limit: info.metadata['limit'] ?? '',
    value: info.metadata['value'] ?? '',
    retryMs: delay && Number(delay.seconds) * 1000 + delay.nanos / 1e6,
  };
}

/** Returns what our server says about an error; undefined if the error is not from it. */
export function detailOf(error: ConnectError): ErrorDetail | undefined {
  try {
    return parse(error);
  } catch {
    return undefined; // malformed bytes
  }
}

/** Returns an error with details, as `detailOf` finds them. */
export function errorWith(
  code: Code,
  message: string,
  { reason = '', field, resource, limit, value, retryMs }: Partial<ErrorDetail>,
): ConnectError {
  const error = new ConnectError(message, code);
  const add = <Desc extends DescMessage>(schema: Desc, init: MessageInitShape<Desc>): void => {
    const bytes = toBinary(schema, create(schema, init));
    error.details.push({ type: typeOf(schema), value: bytes });
  };
  const metadata = { ...(limit && { limit }), ...(value && { value }) };
  add(ErrorInfoSchema, { reason, domain, metadata });
  if (field) add(BadRequestSchema, { fieldViolations: [{ field }] });
  if (resource) add(ResourceInfoSchema, { resourceName: resource });
  if (retryMs !== undefined) {
    const seconds = Math.floor(retryMs / 1000);
    const nanos = Math.round((retryMs - seconds * 1000) * 1e6);
    add(RetryInfoSchema, { retryDelay: { seconds: BigInt(seconds), nanos } });
  }
  return error;
}
