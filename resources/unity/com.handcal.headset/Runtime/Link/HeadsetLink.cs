using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Net;
using System.Net.Sockets;
using System.Threading;

namespace Handcal.Link
{
    /// <summary>
    /// The headset's end of the link: it connects to the PC, stays connected, answers it, and holds
    /// the state to show. It has a thread of its own; every method may be called from any thread.
    /// </summary>
    public sealed class HeadsetLink : IDisposable
    {
        const double HelloPeriodS = 0.1, RefusedPeriodS = 1.0, SilenceS = 2.0, ReopenPeriodS = 1.0;
        const int IdleWaitUs = 20000, ReceiveBufferBytes = 4 << 20, PosesPerDatagram = 3, Byes = 3;
        const int BatchDatagrams = 256;
        internal const int MostUdpBytes = 1 << 16;  // Windows has an error for what is longer than the buffer
        static readonly Stopwatch Clock = Stopwatch.StartNew();

        readonly object gate = new object();
        readonly string host;
        readonly int port;
        readonly Func<long> clockNs;
        readonly Thread thread;
        readonly byte[] received = new byte[MostUdpBytes], sent = new byte[Datagram.MaxBytes];
        readonly Handshake handshake;
        readonly Outbox outbox = new Outbox();
        readonly Queue<ProtoWriter> poses = new Queue<ProtoWriter>();
        readonly Kept kept;
        readonly long[] rejected = new long[Enum.GetValues(typeof(Rejection)).Length];
        volatile bool isClosing;
        Socket socket;
        Session session;
        Device device = new Device();
        HeadsetState state = new HeadsetState(), handedOut;
        bool isKeptChanged, isDismissed;
        double nextHelloS;
        string problem = "", refusal = "";

        /// <param name="host">Address of the PC. Empty: nobody is called, but kept projections are shown.</param>
        /// <param name="pairingKey">At least 16 bytes.</param>
        /// <param name="deviceId">The headset's own number, made once and kept.</param>
        /// <param name="device">The introduction; see <see cref="SetDevice"/>.</param>
        /// <param name="kept">Projections of earlier sessions; the newest are shown.</param>
        /// <param name="clockNs">The headset's monotonic clock, on which poses are stamped.</param>
        public HeadsetLink(
            string host, int port, byte[] pairingKey, ulong deviceId, Device device, Kept kept, Func<long> clockNs)
        {
            if (pairingKey.Length < Keys.MinPairingKeyBytes)
                throw new ArgumentException("the pairing key has fewer than 16 bytes");
            this.host = host;
            this.port = port;
            this.device = device;
            this.kept = kept;
            this.clockNs = clockNs;
            handshake = new Handshake(pairingKey, deviceId);
            ShowNewest();
            thread = new Thread(Run) { IsBackground = true, Name = "handcal link" };
            if (host.Length > 0) thread.Start();
        }

        public bool IsConnected
        {
            get { lock (gate) return session != null && !IsSilent(); }
        }

        /// <summary>True if the PC has said good-bye and has not come back.</summary>
        public bool IsDismissed
        {
            get { lock (gate) return isDismissed; }
        }

        /// <summary>The reason for not being connected, for the wearer; empty if none is known.</summary>
        public string Problem
        {
            get { lock (gate) return IsConnected ? "" : refusal.Length > 0 ? refusal : problem; }
        }

        /// <summary>Number of datagrams dropped for a reason.</summary>
        public long Rejected(Rejection reason)
        {
            return Interlocked.Read(ref rejected[(int)reason]);
        }

        /// <summary>
        /// The state to show; without a connection only the projections. The same object until
        /// something has changed; its live hand is overwritten by the next call.
        /// </summary>
        public HeadsetState State()
        {
            lock (gate)
            {
                state.Live?.Decode();
                return handedOut = handedOut ?? state.Copy();
            }
        }

        /// <summary>Introduces the headset again after a change, as when the runtime moves its views.</summary>
        public void SetDevice(Device changed)
        {
            lock (gate)
            {
                device = changed;
                Introduce();
            }
        }

        /// <summary>Sends T_W_H, its upper 3×4, at the time that the pose is for.</summary>
        public void SendPose(double[] TWH, long timeNs)
        {
            lock (gate)
            {
                poses.Enqueue(Envelope.Pose(timeNs, TWH));
                if (poses.Count > PosesPerDatagram) poses.Dequeue();
                Send(Envelope.Poses(poses));
            }
        }

        /// <summary>Says that the hand covers the cursor, with the state drawn at that time.</summary>
        public Outgoing Confirm(long timeNs, HeadsetState drawn)
        {
            uint cursor = drawn.Cursor == null ? 0 : drawn.Cursor.Id;
            return SendReliably(Slot.Confirm, Envelope.Confirm(timeNs, cursor, drawn.Digest()));
        }

        /// <summary>Says how far the wearer has moved the drawing, and whether it `fits` the hand.</summary>
        public Outgoing Nudge(long timeNs, HeadsetState drawn, NudgeSum moved, bool fits)
        {
            byte[] message = Envelope.Nudge(drawn.Verify.Id, moved, fits, timeNs, drawn.Digest());
            return SendReliably(Slot.Nudge, message);
        }

        /// <summary>Draws with the kept projections of a wearer; false if there are none.</summary>
        public bool ShowKept(string wearer)
        {
            lock (gate)
            {
                if (!kept.Recall(wearer)) return false;
                ShowNewest();
                Introduce();
                return true;
            }
        }

        /// <summary>The wearers whose projections are kept, the newest first.</summary>
        public string[] KeptWearers()
        {
            lock (gate)
            {
                var wearers = new string[kept.Count];
                for (int age = 0; age < wearers.Length; age++)
                    wearers[age] = (kept.Left(age) ?? kept.Right(age)).Wearer;
                return wearers;
            }
        }

        /// <summary>The kept projections to store if they have changed since the last call, else null.</summary>
        public byte[] TakeKept()
        {
            lock (gate)
            {
                if (!isKeptChanged) return null;
                isKeptChanged = false;
                return kept.ToBytes();
            }
        }

        /// <summary>Says good-bye and lets the thread end, which may take a name server's time.</summary>
        public void Dispose()
        {
            if (isClosing) return;
            lock (gate)
            {
                for (int i = 0; i < Byes; i++) Send(Envelope.Bye());
                isClosing = true;
            }
        }

        void Run()
        {
            while (!isClosing)
            {
                try
                {
                    if (socket == null) socket = Open(host, port);
                    bool hasArrived = socket.Poll(IdleWaitUs, SelectMode.SelectRead);
                    for (int i = 0; i < BatchDatagrams && hasArrived && !isClosing; i++)
                    {
                        Take(socket.Receive(received));
                        hasArrived = socket.Available > 0;
                    }
                    lock (gate)
                        if (!isClosing) Work(Now);
                }
                catch (SocketException error)
                {
                    if (IsHarmless(error)) Thread.Sleep(IdleWaitUs / 1000);
                    else Lose(error);
                }
                // Of a name that is none, or a socket that the system took away while suspended.
                catch (Exception error) when (!(error is ThreadAbortException))
                {
                    Lose(error);
                }
            }
            socket?.Close();
        }

        /// <summary>True if nobody listens there yet, or a datagram is unreadable: go on.</summary>
        internal static bool IsHarmless(SocketException error)
        {
            return error.SocketErrorCode == SocketError.ConnectionReset
                || error.SocketErrorCode == SocketError.ConnectionRefused
                || error.SocketErrorCode == SocketError.MessageSize
                || error.SocketErrorCode == SocketError.WouldBlock;
        }

        internal static Socket Open(string host, int port)
        {
            IPAddress[] addresses = Dns.GetHostAddresses(host);
            if (addresses.Length == 0) throw new SocketException((int)SocketError.HostNotFound);
            IPAddress address = Array.Find(addresses, one => one.AddressFamily == AddressFamily.InterNetwork);
            address = address ?? addresses[0];
            var opened = new Socket(address.AddressFamily, SocketType.Dgram, ProtocolType.Udp);
            opened.Blocking = false;
            opened.ReceiveBufferSize = ReceiveBufferBytes;
            opened.Connect(address, port);  // datagrams of others are dropped by the system
            return opened;
        }

        /// <summary>Closes the socket, as after a suspension or without a network, and waits.</summary>
        void Lose(Exception error)
        {
            lock (gate)
            {
                problem = "The PC at " + host + " cannot be reached: " + error.Message;
                EndSession();
                socket?.Close();
                socket = null;
            }
            for (double endS = Now + ReopenPeriodS; Now < endS && !isClosing;) Thread.Sleep(IdleWaitUs / 1000);
        }

        /// <summary>
        /// Takes a datagram. The lock, which drawing needs, is held only for those of the PC: of
        /// strangers' there may be more than this thread can check.
        /// </summary>
        void Take(int size)
        {
            Rejection rejection;
            try
            {
                rejection = Sort(size);
            }
            catch (MalformedException)
            {
                rejection = Rejection.Corrupt;
            }
            Interlocked.Increment(ref rejected[(int)rejection]);
            if (rejection == Rejection.WrongVersion)
                lock (gate) problem = "The PC speaks protocol " + received[2] + ", this app protocol " + Datagram.Version
                    + ": update the older one";
        }

        Rejection Sort(int size)
        {
            Rejection rejection = Datagram.Read(received, size, out Packet packet);
            if (rejection != Rejection.None) return rejection;
            if (packet.Session == 0)
            {
                if (session != null) return Rejection.Replayed;
                return Greet(packet, size);
            }
            if (session == null || packet.Session != session.Number) return Rejection.WrongSession;
            if (!Datagram.IsAuthentic(session.ReceiveMac, received, size)) return Rejection.Unpaired;
            if (!session.Window.Accept(packet.Sequence)) return Rejection.Replayed;
            lock (gate)
            {
                session.HeardS = Now;
                if (packet.Slot == Slot.Unreliable) Handle(new ProtoReader(received, packet.Start, packet.Count));
                else
                {
                    byte[] message = session.Inbox.Receive(packet);
                    if (message != null) Handle(new ProtoReader(message));
                }
            }
            return Rejection.None;
        }

        Rejection Greet(Packet packet, int size)
        {
            Rejection rejection = handshake.Take(packet, received, size, out Answer answer);
            if (rejection != Rejection.None) return rejection;
            lock (gate) Follow(answer);
            return Rejection.None;
        }

        void Follow(Answer answer)
        {
            switch (answer)
            {
                case Answer.SayHelloAgain:
                    SayHello();
                    break;
                case Answer.Welcomed:
                    EndSession();
                    session = handshake.Session;
                    session.HeardS = Now;
                    isDismissed = false;
                    problem = refusal = "";
                    nextHelloS = 0;
                    Introduce();
                    break;
                case Answer.Refused:
                    refusal = handshake.Refusal;
                    nextHelloS = Now + RefusedPeriodS;
                    break;
            }
        }

        void Handle(ProtoReader envelope)
        {
            if (!envelope.Next(out int number)) throw new MalformedException("an empty envelope");
            var body = (Body)number;
            ProtoReader message = envelope.Message();
            switch (body)
            {
                case Body.Ping: AnswerPing(message); break;
                case Body.Ack: outbox.Acknowledge(message); break;
                case Body.Projection: Keep(new Projection(message)); break;
                case Body.Bye:
                    isDismissed = true;
                    EndSession();
                    break;
                default:
                    state.Take(body, message);
                    handedOut = null;
                    break;
            }
        }

        void AnswerPing(ProtoReader ping)
        {
            long receivedNs = clockNs();
            ulong sentHostNs = 0;
            while (ping.Next(out int field))
                if (field == 1) sentHostNs = ping.Fixed();
            ReplayWindow window = session.Window;
            Send(Envelope.Pong(sentHostNs, receivedNs, clockNs(), window.Highest, window.Accepted));
        }

        /// <summary>Draws with a projection and keeps it; both eyes show one wearer.</summary>
        void Keep(Projection projection)
        {
            bool isOther = projection.Wearer != state.Wearer || projection.Rig != state.Rig;
            kept.Add(projection);
            isKeptChanged = true;
            ShowNewest();
            if (isOther) Introduce();
        }

        void ShowNewest()
        {
            if (kept.Count == 0) return;
            state.Left = kept.Left();
            state.Right = kept.Right();
            handedOut = null;
        }

        /// <summary>Removes everything but the projections: the PC sends it again when it is back.</summary>
        void EndSession()
        {
            session = null;
            state = new HeadsetState { Left = state.Left, Right = state.Right };
            handedOut = null;
        }

        void Introduce()
        {
            SendReliably(Slot.Device, Envelope.Device(device, state.Wearer, state.Rig));
        }

        void Work(double nowS)
        {
            if (session != null && IsSilent()) EndSession();
            if (session != null && session.Inbox.OwesReceipts) Send(Envelope.Ack(session.Inbox.TakeReceipts()));
            outbox.SendDue(nowS, SendPacket);
            if (nowS < nextHelloS) return;
            nextHelloS = nowS + HelloPeriodS;
            if (session == null) SayHello();
            else Send(Envelope.Ack(new ProtoWriter[0]));  // keeps the session alive
        }

        void SayHello()
        {
            socket.Send(sent, handshake.Hello(device.Name, sent), SocketFlags.None);
        }

        Outgoing SendReliably(Slot slot, byte[] envelope)
        {
            lock (gate)
            {
                double nowS = Now;
                Outgoing message = outbox.Send(slot, envelope, nowS);
                outbox.SendDue(nowS, SendPacket);
                return message;
            }
        }

        void Send(byte[] envelope)
        {
            SendPacket(new Packet { Bytes = envelope, Count = envelope.Length, FragmentCount = 1 });
        }

        void SendPacket(Packet packet)
        {
            if (session == null || socket == null) return;
            packet.Session = session.Number;
            packet.Sequence = ++session.Sequence;
            int size = Datagram.Seal(session.SendMac, packet, sent);
            try
            {
                socket.Send(sent, size, SocketFlags.None);
            }
            catch (SocketException)
            {
                // As if lost on the way; the thread's next call finds out what is wrong.
            }
        }

        static double Now { get { return Clock.Elapsed.TotalSeconds; } }

        bool IsSilent()
        {
            return Now - session.HeardS > SilenceS;
        }
    }
}
