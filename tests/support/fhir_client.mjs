// Reads a session by fhir-kit-client and judges each resource by fhir.js: neither is ours.
// Arguments: the FHIR address, an API token. Prints {abilities, found: {type: [resource]}, problems}.
import { Client } from "fhir-kit-client";
import { Fhir } from "fhir";

const [baseUrl, bearerToken] = process.argv.slice(2);
const client = new Client({ baseUrl, bearerToken });
const judge = new Fhir();
const found = {};
const problems = [];

function check(resource) {
    const { valid, messages } = judge.validate(resource, { errorOnUnexpected: true });
    if (!valid) problems.push({ resource, messages });
}

async function search(resourceType, searchParams) {
    let page = await client.search({ resourceType, searchParams });
    found[resourceType] = [];
    while (page) {
        check(page);
        found[resourceType].push(...(page.entry ?? []).map(({ resource }) => resource));
        page = await client.nextPage({ bundle: page });
    }
}

check({ resourceType: "Observation" }); // a detector that is shown to detect
if (!problems.pop()) throw new Error("fhir.js lets an Observation pass that observes nothing.");
const abilities = await client.capabilityStatement();
check(abilities);
await search("Patient", {});
const patient = found.Patient[0].id;
for (const type of ["Encounter", "Observation", "QuestionnaireResponse", "Provenance", "Goal"]) {
    await search(type, { patient: `Patient/${patient}`, _count: 1 });
}
await search("Device", {});
for (const reference of [found.Observation[0].subject, found.Observation[0].encounter, found.Observation[0].device]) {
    check(await client.resolve({ reference: reference.reference }));
}
console.log(JSON.stringify({ abilities, found, problems }));
