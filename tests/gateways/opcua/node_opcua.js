// A client that nobody here wrote: node-opcua. Starts a job by OPC 40100-1, and prints what it was told, as JSON.
// Arguments: endpoint, folder for its own certificate, key.
const fs = require("node:fs");
const path = require("node:path");
const opcua = require("node-opcua-client");
const { OPCUACertificateManager } = require("node-opcua-certificate-manager");

const [endpoint, folder, key] = process.argv.slice(2);
const AUTOMATIC = "cell7.VisionStateMachine.AutomaticModeStateMachine";

async function main() {
  const pki = new OPCUACertificateManager({ rootFolder: path.join(folder, "node"), automaticallyAcceptUnknownCertificate: true });
  await pki.initialize();
  const client = opcua.OPCUAClient.create({
    applicationName: "foreign",
    securityMode: opcua.MessageSecurityMode.SignAndEncrypt,
    securityPolicy: opcua.SecurityPolicy.Basic256Sha256,
    clientCertificateManager: pki,
    endpointMustExist: false,
    connectionStrategy: { maxRetry: 1 },
  });
  await client.createDefaultCertificate();
  fs.copyFileSync(client.certificateFile, path.join(folder, "trusted", "node.pem"));
  await client.connect(endpoint);
  const session = await client.createSession({ type: opcua.UserTokenType.UserName, userName: "mes", password: key });
  const names = await session.readNamespaceArray();
  const cells = names.indexOf("urn:handeyed:cells");
  const types = names.indexOf("http://opcfoundation.org/UA/MachineVision");
  const node = (name) => `ns=${cells};s=${name}`;
  const told = { events: [], conditions: [], atServer: [], refreshed: [] };

  const subscription = await session.createSubscription2({ requestedPublishingInterval: 50, publishingEnabled: true });
  const filter = opcua.constructEventFilter(["EventType", "Message", `${types}:ResultState`, `${types}:MeasId`, `${types}:JobId`, `${types}:ResultContent`, `${types}:PartId`, "ConditionName", "Retain"]);
  const item = await subscription.monitor(
    { nodeId: node("cell7"), attributeId: opcua.AttributeIds.EventNotifier },
    { samplingInterval: 0, discardOldest: false, queueSize: 100, filter },
    opcua.TimestampsToReturn.Both,
  );
  const alarms = await session.createSubscription2({ requestedPublishingInterval: 50, publishingEnabled: true });
  const ofServer = await alarms.monitor(
    { nodeId: "i=2253", attributeId: opcua.AttributeIds.EventNotifier },
    { samplingInterval: 0, discardOldest: false, queueSize: 100, filter: opcua.constructEventFilter(["EventType", "Message"]) },
    opcua.TimestampsToReturn.Both,
  );
  const refreshed = new Promise((resolve) => ofServer.on("changed", ([type, message]) => {
    if (type.value.namespace) return told.atServer.push(message.value.text);
    told.refreshed.push(type.value.value);
    if (type.value.value === 2788) resolve();
  }));
  const refresh = await session.call({
    objectId: "i=2782",
    methodId: "i=3875",
    inputArguments: [new opcua.Variant({ dataType: opcua.DataType.UInt32, value: alarms.subscriptionId })],
  });
  await refreshed;
  told.refresh = refresh.statusCode.name;
  let ended;
  const end = new Promise((resolve) => (ended = resolve));
  item.on("changed", (fields) => {
    const [type, message, state, measId, jobId, content, partId, condition, retain] = fields.map((field) => field.value);
    if (condition) told.conditions.push([condition, retain]);
    else told.events.push(message.text);
    if (type.value === 1024) {
      Object.assign(told, { state, measId: measId.id, partId: partId.id, resultOf: jobId.id, result: JSON.parse(content[0].value) });
      ended();
    }
  });

  const structure = async (number, fields) => new opcua.Variant({
    dataType: opcua.DataType.ExtensionObject,
    value: await session.constructExtensionObject(opcua.resolveNodeId(`ns=${types};i=${number}`), fields),
  });
  const start = async (measId) => session.call({
    objectId: node(AUTOMATIC),
    methodId: node(`${AUTOMATIC}.StartSingleJob`),
    inputArguments: [
      await structure(3015, { id: measId }),
      await structure(3004, { id: "part 1" }),
      await structure(3002, { id: "calibrate" }),
      await structure(3003, { id: "" }),
      new opcua.Variant({ dataType: opcua.DataType.Variant, arrayType: opcua.VariantArrayType.Array, value: [] }),
    ],
  });
  const answer = await start("order-4711");
  told.started = answer.statusCode.name;
  told.jobId = answer.outputArguments[0].value.id;
  told.again = (await start("order-4711")).outputArguments[0].value.id;
  await end;
  const read = async (name) => (await session.read({ nodeId: node(name), attributeId: opcua.AttributeIds.Value })).value.value;
  told.lastResult = await read("cell7.Cell.LastResult");
  told.active = (await read("cell7.ConfigurationManagement.ActiveConfiguration")).internalId.id;
  const byId = await session.call({
    objectId: node("cell7.ResultManagement"),
    methodId: node("cell7.ResultManagement.GetResultById"),
    inputArguments: [await structure(3021, { id: told.jobId }), new opcua.Variant({ dataType: opcua.DataType.Int32, value: 0 })],
  });
  const result = byId.outputArguments[1].value;
  told.byId = [byId.statusCode.name, result.resultState, result.partId.id];
  await session.close();
  await client.disconnect();
  console.log(JSON.stringify(told));
}

main().then(() => process.exit(0), (error) => { console.error(error); process.exit(1); });
