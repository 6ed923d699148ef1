// Reads and writes the register map with npm's modbus-serial: node modbus_serial.js PORT
const ModbusRTU = require("modbus-serial");
const client = new ModbusRTU();
(async () => {
  await client.connectTCP("127.0.0.1", { port: Number(process.argv[2]) });
  client.setID(1);
  client.setTimeout(10000);
  await client.writeRegister(2, 8);
  await client.writeRegisters(3, [1, 4464]);
  await client.writeCoils(4, [true, true]);
  await client.writeCoil(4, false);
  const constant = await client.readInputRegisters(24, 2);
  const control = await client.readHoldingRegisters(0, 5);
  const coils = await client.readCoils(0, 6);
  const status = await client.readDiscreteInputs(0, 8);
  const at_once = await Promise.all([...Array(16).keys()].map(() => client.readInputRegisters(23, 1)));
  let refused = "";
  try { await client.writeRegister(16, 1); } catch (error) { refused = String(error.modbusCode); }
  console.log(JSON.stringify({
    constant: constant.buffer.readFloatBE(0),
    control: control.data,
    coils: coils.data.slice(0, 6),
    online: status.data[7],
    versions: at_once.map((answer) => answer.data[0]),
    refused,
  }));
  client.close(() => {});
})().catch((error) => { console.error(error); process.exit(1); });
